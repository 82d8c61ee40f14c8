"""The commands that README and docs print: a shell and a parser take all of them, and those of the README run."""

import importlib
import re
import shlex
from pathlib import Path

import pytest

from fusion.cli.main import _verb_parser, main
from fusion.cli.verbs import GROUPS, VERBS

ROOT = Path(__file__).resolve().parents[2]
PAGES = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))}
ADDED = {
    "fusion review": "--save review.rrd",  # no viewer
    "fusion record": "--duration 1",
    "fusion live": "--duration 1",
}
"""Words that end a command which would else go on until somebody ends it."""
EXIT_CODES = {"fusion repair": {3}, "fusion doctor": {0, 1}}
"""Where it is not 0: a cut-off log has lost something; a computer may lack what a robot's has."""
ELSEWHERE = {
    "python3 -m venv": "an environment; `.ci/base` makes one",
    ". venv/bin/activate": "it acts on the shell alone",
    "pip install": "it needs a network; `.ci/base` installs the package",
    "make demo": "sets up an environment; `.ci/run` runs it",
    "make test": "these tests",
    "fusion bench run": "half a minute; tests/benchmarks/runner",
    "fusion bench report": "needs the cells of that; tests/benchmarks/test_report.py",
    "fusion reproduce": "eight minutes; tests/benchmarks/paper",
}
"""Commands of the README that are not run here, with the reason."""


def blocks(page, language):
    return re.findall(rf"```{language}\n(.*?)```", PAGES[page], re.DOTALL)


def lines(page):
    return [line for block in blocks(page, "sh") for line in block.splitlines() if line]


def words_of(line):
    """As a shell takes them, without a redirection at the end."""
    lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
    lexer.whitespace_split = True
    words = list(lexer)
    assert not any(set(word) <= set("|&;()<>") for word in words[:-2]), f"a shell takes a part of it for itself: {line}"
    return words[:-2] if words[-2:-1] == [">"] else words


def parser_of(words):
    """The parser of a command, and the words that are left for it."""
    if words[2:] and words[2] in GROUPS.get(words[1], {}):
        verb = GROUPS[words[1]][words[2]]
        return _verb_parser(" ".join(words[1:3]), verb, importlib.import_module(verb.module)), words[3:]
    verb = VERBS[words[1]]
    return _verb_parser(words[1], verb, importlib.import_module(verb.module)), words[2:]


@pytest.mark.parametrize("page", PAGES)
def test_every_command_is_taken_by_a_shell_and_a_parser(page):
    for words in map(words_of, lines(page)):
        if words[0] == "fusion":
            parser, rest = parser_of(words)
            assert parser.parse_intermixed_args(rest)


@pytest.mark.parametrize("page", [*PAGES, "CHANGELOG.md"])
def test_every_option_of_a_command_within_a_sentence_exists(page):
    text = PAGES.get(page) or (ROOT / page).read_text(encoding="utf-8")
    for command in re.findall(r"`(fusion \w[^`]*)`", text):
        parser, rest = parser_of(command.replace("\n", " ").split())
        options = [word for word in rest if re.match(r"-{1,2}[a-z]", word)]
        assert set(options) <= set(parser._option_string_actions), command


def named(table, line):
    """The entry of a table for a command, by its first words."""
    return next((value for start, value in table.items() if line.startswith(start)), None)


@pytest.fixture
def at_hand(tmp_path, monkeypatch):
    """Files that the README takes for granted: a folder of CSV, a log that was cut off, a robot file."""
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "office", "--duration", "10", "-o", "mine.mcap"]) == 0
    assert main(["export", "mine.mcap", "--csv", "-o", "my_recording"]) == 0
    whole = Path("mine.mcap").read_bytes()
    Path("cut_off.mcap").write_bytes(whole[: len(whole) // 2])
    Path("robot.toml").write_text(blocks("record.md", "toml")[0], encoding="utf-8")


def test_commands_of_the_readme_run_in_their_order(at_hand):
    for line in lines("README.md"):
        if named(ELSEWHERE, line) is None:
            words = words_of(f"{line.partition('#')[0]} {named(ADDED, line) or ''}")
            assert main(words[1:]) in (named(EXIT_CODES, line) or {0}), line


@pytest.mark.parametrize("start", [*ADDED, *EXIT_CODES, *ELSEWHERE])
def test_exceptions_are_those_of_commands_that_are_there(start):
    assert any(line.startswith(start) for line in lines("README.md"))
