"""Metrics of other distributions: what is wrong with them is named, and ours are never lost to them."""

import numpy as np
import pytest

from benchmarks.metrics.catalogue import more_is_better, unit_of
from benchmarks.metrics.families import all_metrics, families, modules
from benchmarks.metrics.score import unanswered
from fusion import PluginError, plugins
from logs.truth import Instants

EMPTY = np.zeros(2)
SILENT = unanswered(Instants(np.array([0, 10**9]), EMPTY, EMPTY, EMPTY))
CODE = """
from benchmarks.metrics.metric import Better, rows

METRICS = rows("visitor_share", "share", Better.MORE, "share of instants far away")


def metrics(measured):
    return {"visitor_share": 0.25}
"""


@pytest.fixture
def brought(declare):
    """The families that are found beside the metrics of a visitor, whose code has replacements made in it."""

    def bring(old="", new="", name="visiting"):
        declare(plugins.METRICS, name, "visitor", CODE.replace(old, new) if old else CODE)
        families.cache_clear()
        return families()

    yield bring
    families.cache_clear()


def test_metrics_of_a_visitor_stand_among_ours_with_unit_and_direction(brought):
    before = modules()
    assert brought().refused == []
    scored = all_metrics(SILENT)
    assert scored["visitor_share"] == 0.25
    assert "pos_p75" in scored
    assert unit_of("visitor_share").name == "%"
    assert more_is_better("visitor_share")
    assert modules() == before | {"visiting": "visitor"}


@pytest.mark.parametrize(
    ("old", "new", "flaw"),
    [
        ('"visitor_share", "share"', '"pos_rmse", "m"', "another family has the id pos_rmse already"),
        ('"share", Better', '"furlong", Better', "visitor_share has the unit 'furlong'"),
        ("METRICS = rows", "METRICS = 7 or rows", "is not a metric: its METRICS is 7"),
        ("METRICS = rows", "METRICS = [7] or rows", "METRICS holds 7"),
        ("def metrics", "def number", "it lacks metrics"),
        ("def metrics(measured)", "def metrics()", "does not take 1 argument"),
        ("METRICS", "1 / 0", "cannot be imported|failed while being imported"),
    ],
)
def test_metrics_that_are_none_are_left_out_in_one_sentence(brought, old, new, flaw):
    before = families().rows
    found = brought(old, new)
    (sentence,) = found.refused
    assert sentence.startswith("metrics are left out: ")
    assert any(one in sentence for one in flaw.split("|")), sentence
    assert found.rows == before


@pytest.mark.parametrize(
    ("new", "flaw"),
    [
        ('{"visitor_share": 1 / 0}', "ZeroDivisionError"),
        ("None", "AttributeError"),
        ('{"near": 1.0}', "near, which has no row"),
    ],
)
def test_metrics_that_fail_are_named_with_their_module(brought, new, flaw):
    brought('{"visitor_share": 0.25}', new)
    with pytest.raises(PluginError, match=flaw) as caught:
        all_metrics(SILENT)
    assert "'visiting'" in str(caught.value)


def test_name_of_ours_that_is_claimed_twice_ends_in_an_error(brought):
    with pytest.raises(PluginError, match="claimed twice"):
        brought(name="errors")
