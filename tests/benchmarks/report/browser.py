"""A real browser without a display, for pages that must work in one."""

import shutil
import subprocess

import pytest

CHROMIUM = pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to look at the page with")


def chromium(folder, *words):
    """The finished process; what a page writes to the console is in its standard error, after the word CONSOLE."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]
    command = ["chromium", *options, f"--user-data-dir={folder}/profile", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
