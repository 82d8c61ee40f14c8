"""The command line: one word, verbs under it (`fusion.cli.verbs`).

A verb's job is also one function with keyword arguments. Exit codes: 0 done, 1 a known error in one sentence, 2 wrong
usage, 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from typing import Any, NoReturn

from fusion.cli.verbs import GROUPS, VERBS, Verb, implementation, plugin_verbs, refused_verbs
from fusion.collection import collect_seldom
from fusion.errors import FusionError, PluginError, did_you_mean


class _Parser(argparse.ArgumentParser):
    """An argument parser that answers unknown verbs with the nearest one."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: {message}\n")


def _verb_parser(name: str, verb: Verb, module: Any) -> argparse.ArgumentParser:  # noqa: ANN401 - a module
    group = "\n".join(f"  fusion {name} {word:<8} {sub.summary}" for word, sub in GROUPS.get(name, {}).items())
    parser = _Parser(
        prog=f"fusion {name}",
        description=verb.summary,
        epilog=group,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    try:
        module.configure(parser)
    except Exception as error:
        if verb.module is None:
            raise PluginError(f"the verb {name!r} of {verb.summary} failed to add its arguments: {error!r}") from error
        raise
    return parser


def _usage() -> str:
    verbs = VERBS | plugin_verbs()
    width = max(map(len, verbs))
    rows = "\n".join(f"  {name:<{width}}  {verb.summary}" for name, verb in verbs.items())
    refused = "".join(f"fusion: {sentence}\n" for sentence in refused_verbs())
    return (
        "usage: fusion VERB ...\n\nWhich filter should run on my robot, and can I trust it?\n\n"
        f"{rows}\n\n`fusion VERB --help` shows more of each; `fusion demo` is the place to start.\n{refused}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command line; answers its exit code."""
    collect_seldom()
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0] in ("-h", "--help"):
        sys.stdout.write(_usage())
        return 0 if words else 2
    if words[0] == "--version":
        from fusion import __version__

        sys.stdout.write(f"fusion {__version__}\n")
        return 0
    verbs = VERBS if words[0] in VERBS else VERBS | plugin_verbs()
    if words[0] not in verbs:
        sys.stderr.write(f"fusion: there is no verb {words[0]!r}; {did_you_mean(words[0], verbs)}\n")
        return 2
    group = GROUPS.get(words[0], {})
    if len(words) > 1 and words[1] in group:
        return _run(" ".join(words[:2]), group[words[1]], words[2:])
    return _run(words[0], verbs[words[0]], words[1:])


def _run(name: str, verb: Verb, words: Sequence[str]) -> int:
    try:
        module = implementation(name, verb)
        parsed = _verb_parser(name, verb, module).parse_intermixed_args(words)
        return _exit_code(module.run(parsed), name)
    except FusionError as error:
        sys.stderr.write(f"fusion {name}: {error}\n")
        return 1
    except KeyboardInterrupt:
        sys.stderr.write(f"fusion {name}: interrupted\n")
        return 130
    except BrokenPipeError:
        # The reader of our output went away (`fusion info RUN | head`): nothing is wrong here.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _exit_code(answer: object, name: str) -> int:
    if not isinstance(answer, int):
        raise PluginError(f"run() answered {answer!r}, no exit code; correct the plug-in that brings {name!r}")
    return answer


if __name__ == "__main__":
    sys.exit(main())
