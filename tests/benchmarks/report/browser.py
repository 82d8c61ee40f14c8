"""A real browser without a display, for pages that must work in one."""

import shutil
import subprocess
from contextlib import suppress

import pytest

CHROMIUM = pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to look at the page with")


def chromium(folder, *words):
    """The finished process; what a page writes to the console is in its standard error, after the word CONSOLE.

    Twice, a start beside other work did not end in two minutes, and ended in seconds when repeated: so it has a second
    try. A page that hangs, hangs twice.
    """
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr"]

    def look(profile):
        command = ["chromium", *options, f"--user-data-dir={folder}/{profile}", *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)

    with suppress(subprocess.TimeoutExpired):
        return look("profile")
    return look("second-profile")
