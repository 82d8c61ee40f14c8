"""Entries come whole or not at all, and the first one stays."""

import pytest

from benchmarks.runner.store import Store, key_of, to_json
from fusion import FusionError

KEY = key_of({"a": 1})


def test_what_was_written_is_read_and_what_was_not_is_reported(tmp_path):
    store = Store(tmp_path / "store")
    assert not store.has("scores", KEY)
    store.write("scores", KEY, {"result.json": to_json({"b": [1.5, None]})})
    assert store.has("scores", KEY)
    assert store.read_json("scores", KEY, "result.json") == {"b": [1.5, None]}
    with pytest.raises(FusionError, match="cannot be read"):
        store.read("scores", KEY, "track.npz")


def test_an_entry_that_is_there_is_left_as_it_is_and_no_rest_stays_behind(tmp_path):
    store = Store(tmp_path)
    store.write("scores", KEY, {"x": b"first"})
    store.write("scores", KEY, {"x": b"second"})
    assert store.read("scores", KEY, "x") == b"first"
    assert [path.name for path in store.place("scores", KEY).parent.iterdir()] == [KEY[2:]]


def test_half_an_entry_that_a_killed_runner_left_is_no_entry(tmp_path):
    store = Store(tmp_path)
    beside = store.place("scores", KEY).parent / ".half"
    beside.mkdir(parents=True)
    (beside / "result.json").write_bytes(b"{")
    assert not store.has("scores", KEY)
    store.write("scores", KEY, {"result.json": b"{}"})
    assert store.has("scores", KEY)


def test_damaged_entry_is_reported_with_the_folder_to_delete(tmp_path):
    store = Store(tmp_path)
    store.write("scores", KEY, {"result.json": b"{"})
    with pytest.raises(FusionError, match=f"is damaged .*; delete {store.place('scores', KEY)} and run again"):
        store.read_json("scores", KEY, "result.json")


def test_place_that_cannot_be_written_is_reported(tmp_path):
    (tmp_path / "scores").write_text("a file where a folder should be")
    with pytest.raises(FusionError, match=r"cannot be written .* --store"):
        Store(tmp_path).write("scores", KEY, {"x": b""})


@pytest.mark.parametrize("other", [{"a": 2}, {"a": 1.0}, {"a": "1"}, {"b": 1}, {"a": 1, "b": None}])
def test_keys_distinguish_what_differs(other):
    assert key_of(other) != KEY
