"""The page on architecture names rooms and modules that are there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ROOMS = ("fusion", "estimators", "logs", "sensors", "benchmarks")


def test_every_room_and_module_of_the_page_is_there():
    named = [path for path in re.findall(r"`([\w/]+(?:\.py|/))`", PAGE) if path.partition("/")[0] in ROOMS]
    assert len(named) > 30
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_the_page_is_short_enough_to_be_read():
    assert len(PAGE.splitlines()) < 120
