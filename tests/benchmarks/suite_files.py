"""Suites of tests, as files."""

from benchmarks.runner.suite_file import load_suite


def write_suite(folder, text):
    """Writes ``text`` as ``suite.toml`` into ``folder``, and loads it."""
    path = folder / "suite.toml"
    path.write_text(text, encoding="utf-8")
    return load_suite(path)
