"""Results of a suite for other programs: CSV, LaTeX, JUnit."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from io import StringIO
from pathlib import Path
from xml.etree import ElementTree

from benchmarks.runner.leaderboard import suite_leaderboard
from benchmarks.runner.results import Result, flat, record
from benchmarks.runner.scoring import ALIVE
from benchmarks.runner.suite import Suite
from fusion.output.files import write, write_json
from fusion.output.tables import Table, as_markdown

LATEX_SPECIAL = {letter: f"\\{letter}" for letter in "_%&#${}"} | {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "°": r"$^\circ$",
    "∞": r"$\infty$",
    "\n": " ",
}


def as_csv(results: Sequence[Result]) -> bytes:
    """One row per cell; what is infinite or does not exist is empty."""
    rows = [flat(result) for result in results]
    names = list(dict.fromkeys(name for row in rows for name in row))
    text = StringIO()
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    return text.getvalue().encode()


def as_latex(table: Table) -> bytes:
    """A ``tabular`` of the table (booktabs)."""
    columns = "l" + "r" * (len(table.head) - 1)
    rows = [" & ".join(map(_latex, row)) + r" \\" for row in (table.head, *table.rows)]
    body = "\n".join([rows[0], r"\midrule", *rows[1:]])
    head = f"% {table.title}\n\\begin{{tabular}}{{{columns}}}\n\\toprule\n"
    return f"{head}{body}\n\\bottomrule\n\\end{{tabular}}\n".encode()


def _latex(text: str) -> str:
    return "".join(LATEX_SPECIAL.get(letter, letter) for letter in text)


def as_junit(suite: Suite, results: Sequence[Result]) -> bytes:
    """One test case per cell: a lost cell is a failure."""
    lost = [result for result in results if result.status not in ALIVE]
    root = ElementTree.Element("testsuite", name=suite.name, tests=str(len(results)), failures=str(len(lost)))
    for result in results:
        cell = result.cell
        case = ElementTree.SubElement(
            root, "testcase", classname=f"{cell.run.id}.{cell.fault.id}", name=f"{cell.estimator.id}[{cell.seed}]"
        )
        if result.status not in ALIVE:
            ElementTree.SubElement(case, "failure", message=result.status).text = _printable(
                result.error or result.status
            )
    return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)) + b"\n"


def _printable(text: str) -> str:
    """XML has no control characters, and the error of an estimator may hold any."""
    return "".join(letter if letter.isprintable() or letter == "\n" else "?" for letter in text)


Writer = Callable[[Suite, Sequence[Result], Path], None]


WRITERS: dict[str, tuple[Writer, str]] = {
    "json": (
        lambda suite, results, path: write_json(path, record(suite, results)),
        "every number; a baseline for gate",
    ),
    "csv": (lambda _, results, path: write(path, as_csv(results)), "one row per cell"),
    "latex": (
        lambda _, results, path: write(path, as_latex(suite_leaderboard(results))),
        "the leaderboard as a tabular",
    ),
    "markdown": (
        lambda _, results, path: write(path, (as_markdown(suite_leaderboard(results)) + "\n").encode()),
        "the leaderboard as a table",
    ),
    "junit": (lambda suite, results, path: write(path, as_junit(suite, results)), "one test case per cell"),
}
