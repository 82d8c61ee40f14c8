"""Cycles are looked for seldom in our programs, and still found."""

import gc

import pytest

from fusion.cli.main import main


@pytest.fixture
def threshold():
    before = gc.get_threshold()
    yield
    gc.set_threshold(*before)


@pytest.mark.usefixtures("threshold")
def test_every_verb_looks_for_cycles_seldom(capsys):
    gc.set_threshold(700, 10, 10)
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("fusion ")
    assert gc.isenabled()
    assert gc.get_threshold()[0] >= 100_000
