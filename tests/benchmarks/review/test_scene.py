"""What a review holds, read back from its file."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import gammaincinv

import fusion
from benchmarks.review.blueprint import reach
from benchmarks.review.canvas import MOST_POSES, mostly_jumps, thinned
from benchmarks.review.counterfactual import without_anchor
from benchmarks.review.drawing import drawings
from benchmarks.review.estimator_layer import PARTICLE_PIXELS, newest
from benchmarks.review.estimator_plots import NEES_BOUNDS
from benchmarks.review.folding import Reviewed, counterfactual
from benchmarks.review.particle_clouds import MOST_POINTS, CloudWatch
from benchmarks.review.scene import markdown, write_scene
from benchmarks.runner.estimator_run import run_estimator
from fusion import (
    Covariance,
    Decision,
    Estimate,
    Fate,
    FusionError,
    Pose,
    Reason,
    RssiReading,
    Truth,
    WifiScan,
)
from fusion.output.colours import ESTIMATORS, colour_of
from logs.run import Run
from logs.truth import TruthTrack

rerun = pytest.importorskip("rerun", reason="needs the extra `review`")

SECOND_NS = 1_000_000_000
WORLD = fusion.World.from_table(
    {
        "name": "room",
        "walls": [[[0, 0], [4, 0]]],
        "anchors": [
            {"id": "02:00:5e:00", "position_m": [0, 0]},
            {"id": "b", "position_m": [4, 0]},
            {"id": "c", "position_m": [0, 4]},
        ],
    }
)
VARIANCES = Covariance(0.04, 0.03, 0.0, 0.04, 0.0, 0.01)


class Straight:
    """Goes along x at 1 m/s, 0.5 m beside the truth, and refuses every other reading."""

    summary = "straight"
    tags = frozenset()

    def __init__(self, world):
        pass

    def start(self, prior, seed):
        return 0

    def step(self, state, motion, scan):
        if scan is None:
            return state, ()
        decision, reason = ((Decision.USED, Reason.OK), (Decision.REJECTED, Reason.GATE))[state % 2]
        head = scan.time_ns, scan.sensor, scan.seq
        weight = float(decision is Decision.USED)
        fates = [Fate(*head, r.anchor, decision, reason, weight, 1.0, 4.0, 0.25) for r in scan.readings]
        return state + 1, tuple(fates)

    def estimate(self, state, motion, time_ns):
        return Estimate(time_ns, Pose(time_ns / SECOND_NS - 100.0, 0.5, 0.0), VARIANCES)


class Silent(Straight):
    """Never has a valid answer."""

    def estimate(self, state, motion, time_ns):
        return super().estimate(state, motion, time_ns)._replace(valid=False)


class Poisoned(Straight):
    """No number from the fifth scan on."""

    def estimate(self, state, motion, time_ns):
        answer = super().estimate(state, motion, time_ns)
        return answer if state < 5 else answer._replace(pose=answer.pose._replace(x=math.nan))


class Broken(Straight):
    def step(self, state, motion, scan):
        raise ZeroDivisionError("on purpose")


def run_of(tmp_path, *, with_truth=True):
    stamps = [100 * SECOND_NS + k * SECOND_NS // 2 for k in range(9)]
    readings = tuple(RssiReading(anchor.id, -50.0) for anchor in WORLD.anchors)
    measurements = tuple(WifiScan(stamp, "wifi", k, readings) for k, stamp in enumerate(stamps))
    truth = TruthTrack.from_truths([Truth(stamp, stamp / SECOND_NS - 100.0, 0.0, 0.0) for stamp in stamps])
    return Run(tmp_path / "run.mcap", "test run", WORLD, None, {}, measurements, truth if with_truth else None, (), {})


@pytest.fixture(autouse=True)
def _estimators():
    with fusion.registered("toy", Straight), fusion.registered("silent", Silent), fusion.registered("broken", Broken):
        yield


def scored(run, names):
    return [Reviewed.of(run, run_estimator(run, name)) for name in names]


def review_of(tmp_path, *names, with_truth=True):
    """The chunks of a review by entity path."""
    run = run_of(tmp_path, with_truth=with_truth)
    (scene,) = write_scene(tmp_path / "review.rrd", run, scored(run, names))
    return chunks_of(scene)


def chunks_of(scene):
    from rerun.chunk import RrdReader

    chunks = {}
    for chunk in RrdReader(scene).stream().to_chunks():
        chunks.setdefault(str(chunk.entity_path), []).append(chunk.to_record_batch())
    return chunks


def column(chunks, path, name):
    """All rows of one component over time: static ones stand apart."""
    batches = [batch for batch in chunks[path] if "t" in batch.schema.names]
    (batch,) = [batch for batch in batches if any(name in field for field in batch.schema.names)]
    (field,) = [field for field in batch.schema.names if name in field]
    return batch.column("t").to_numpy(zero_copy_only=False), batch.column(field).to_pylist()


def test_review_holds_floor_truth_tracks_errors_weights_and_readings(tmp_path):
    chunks = review_of(tmp_path, "toy")
    parts = {"path", "trail", "pose"}
    expected = {"/map", "/map/walls", "/map/anchor/b", "/map/legend/toy", "/scores"}
    expected |= {f"/map/truth/{part}" for part in (*parts, "heading")} | {f"/map/estimate/toy/{part}" for part in parts}
    expected |= {"/map/estimate/toy/covariance", "/error/toy", "/heading_error/toy"}
    expected |= {"/weight/toy/b", "/nis/toy/b", "/rssi/b"}
    assert expected <= chunks.keys()


def test_run_in_unix_time_is_on_a_second_timeline_and_another_is_not(tmp_path):
    since_start = run_of(tmp_path)
    unix_ns = 1_627_997_452 * SECOND_NS
    moved = [replace(scan, time_ns=scan.time_ns + unix_ns) for scan in since_start.measurements]
    truth = replace(since_start.truth, time_ns=since_start.truth.time_ns + unix_ns)
    run = replace(since_start, measurements=tuple(moved), truth=truth)
    (scene,) = write_scene(tmp_path / "review.rrd", run, scored(run, ["toy"]))
    (batch,) = [batch for batch in chunks_of(scene)["/rssi/b"] if "t" in batch.schema.names]
    assert batch.column("t")[0].as_py().total_seconds() == 0.0
    assert batch.column("utc").to_numpy(zero_copy_only=False).astype(np.int64).tolist() == [m.time_ns for m in moved]
    assert all("utc" not in b.schema.names for b in review_of(tmp_path, "toy")["/rssi/b"])


def test_particles_and_their_effective_number_are_drawn_where_an_estimator_shows_them(tmp_path):
    run = run_of(tmp_path)
    watch = CloudWatch(run)
    particle = Reviewed.of(run, run_estimator(run, "particle", watch=watch), watch.clouds())
    reviewed = [particle, *scored(run, ["toy"])]
    (scene,) = write_scene(tmp_path / "review.rrd", run, reviewed)
    chunks = chunks_of(scene)
    assert not {"/map/estimate/toy/particles", "/neff/toy"} & chunks.keys()
    _, positions = column(chunks, "/map/estimate/particle/particles", "positions")
    assert len(positions) == len(run.measurements)
    assert all(100 < len(row) <= MOST_POINTS for row in positions)
    _, radii = column(chunks, "/map/estimate/particle/particles", "radii")
    assert [min(row) for row in radii] == pytest.approx([-PARTICLE_PIXELS[1]] * len(radii))
    _, effective = column(chunks, "/neff/particle", "Scalars")
    assert np.all((np.ravel(effective) > 1.0) & (np.ravel(effective) < 1000.001))


def test_time_counts_from_the_first_message_and_errors_are_those_of_the_bench(tmp_path):
    time, errors = column(review_of(tmp_path, "toy"), "/error/toy", "Scalars")
    assert time[0] == np.timedelta64(0, "ns")
    assert time[-1] == np.timedelta64(4, "s")
    assert np.allclose(np.ravel(errors), 0.5)


def test_true_heading_is_drawn_only_while_it_is_known(tmp_path):
    run = run_of(tmp_path)
    heading = run.truth.heading.copy()
    heading[[0, 4]] = np.nan
    partly = replace(run, truth=replace(run.truth, heading=heading))
    (scene,) = write_scene(tmp_path / "review.rrd", partly, scored(partly, ["toy"]))
    time, vectors = column(chunks_of(scene), "/map/truth/heading", "vectors")
    assert len(time) == len(heading)
    assert [len(row) for row in vectors] == np.isfinite(heading).astype(int).tolist()


def test_weights_are_one_series_per_anchor(tmp_path):
    _, weights = column(review_of(tmp_path, "toy"), "/weight/toy/b", "Scalars")
    assert np.ravel(weights).tolist() == [1.0, 0.0] * 4 + [1.0]


def test_ellipse_is_the_95_percent_region_turned_the_right_way(tmp_path):
    chunks = review_of(tmp_path, "toy")
    path = "/map/estimate/toy/covariance"
    _, half_sizes = column(chunks, path, "half_sizes")
    _, quaternions = column(chunks, path, "quaternion")
    a, b = np.array(half_sizes[0][0])
    x, y, z, w = np.array(quaternions[0][0])
    angle = 2.0 * math.atan2(z, w)
    rotation = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    region = rotation @ np.diag([a**2, b**2]) @ rotation.T / 5.991464547107979
    assert (x, y) == (0.0, 0.0)
    assert np.allclose(region, [[0.04, 0.03], [0.03, 0.04]], atol=1e-6)


def test_error_line_goes_from_the_estimate_to_the_truth(tmp_path):
    time, strips = column(review_of(tmp_path, "toy"), "/map/estimate/toy/error", "strips")
    assert time[4] == np.timedelta64(2, "s")
    assert strips[4] == [[[2.0, 0.5], [2.0, 0.0]]]


def test_circles_are_those_of_the_last_scan_in_the_colour_of_their_weight(tmp_path):
    chunks = review_of(tmp_path, "toy")
    path = "/map/estimate/toy/readings"
    _, centers = column(chunks, path, "centers")
    _, colours = column(chunks, path, "colors")
    _, half_sizes = column(chunks, path, "half_sizes")
    assert centers[0] == [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]
    assert [len(row) for row in centers] == [3] * 9
    radius_m = float(WORLD.anchors[1].radio.distance(-50.0))
    assert np.allclose(half_sizes[0][1], radius_m)
    assert {tuple(row) for row in colours[::2]} == {(colours[0][0],) * 3}
    assert colours[0][0] != colours[1][0]


def test_circles_are_of_every_anchor_received_within_a_second_and_then_vanish():
    # a, b, a again; c is of no use, and hides the circle that c had.
    time_ns = np.array([0, 400, 600, 700, 900, 1100]) * 1_000_000
    anchor, drawn = np.array([2, 0, 2, 1, 1, 0], dtype=np.int16), np.array([1, 1, 1, 1, 0, 1], dtype=bool)
    at_ns, rows, lengths = newest(time_ns, anchor, drawn, 1_700_000_000)
    seen = [sorted(row.tolist()) for row in np.split(rows, np.cumsum(lengths)[:-1])]
    assert (at_ns / 1e6).tolist() == [0, 400, 600, 700, 900, 1100, 1600]
    assert seen == [[0], [0, 1], [1, 2], [1, 2, 3], [1, 2], [2, 5], [5]]


def test_claim_is_drawn_about_zero_and_the_error_on_it(tmp_path):
    chunks = review_of(tmp_path, "toy")
    _, variances = column(chunks, "/consistency/toy/y/claim", "variances")
    _, values = column(chunks, "/consistency/toy/y/claim", "values")
    _, error = column(chunks, "/consistency/toy/y/error", "Scalars")
    assert np.allclose(np.ravel(variances), 0.04)
    assert np.allclose(np.ravel(values), 0.0)
    assert np.allclose(np.ravel(error), 0.5)
    _, heading = column(chunks, "/consistency/toy/heading/claim", "variances")
    assert np.allclose(np.sqrt(np.ravel(heading)), np.degrees(0.1)), "in degrees"


def test_plot_of_an_error_has_room_for_the_band_that_is_claimed(tmp_path):
    run = run_of(tmp_path)
    (drawing,) = drawings(run, scored(run, ["toy"]))
    for number, error in ((0, 0.0), (1, 0.5)):
        low, high = reach(drawing, number)
        assert low < -0.2  # the estimator claims a standard deviation of 0.2 m
        assert high > max(0.2, error)


def test_worst_moments_stand_below_the_scores_and_nothing_does_without_truth(tmp_path):
    def text(chunks):
        (batch,) = chunks["/scores"]
        (field,) = [field for field in batch.schema.names if field.endswith("text")]
        return batch.column(field).to_pylist()[0][0]

    assert "- toy at 0.00 s: 0.50 m" in text(review_of(tmp_path, "toy"))
    assert "Worst" not in text(review_of(tmp_path, "toy", with_truth=False))


def test_map_has_a_scale_of_a_round_length(tmp_path):
    (batch,) = review_of(tmp_path, "toy")["/map/scale"]
    values = {name.partition(":")[2]: batch.column(name).to_pylist()[0] for name in batch.schema.names if ":" in name}
    ((start, end),) = values["strips"]
    assert np.hypot(*np.subtract(end, start)) == pytest.approx(2.0)  # the floor is 8 m wide
    assert values["labels"] == ["2 m"]


def test_nees_lies_beside_its_bounds_of_three_degrees(tmp_path):
    chunks = review_of(tmp_path, "toy")
    _, lower = column(chunks, "/nees/toy/lower", "Scalars")
    _, upper = column(chunks, "/nees/toy/upper", "Scalars")
    assert [np.ravel(lower)[0], np.ravel(upper)[0]] == [chi_square(0.025, 3), chi_square(0.975, 3)]
    _, nees = column(chunks, "/nees/toy/NEES", "Scalars")
    # (0, 0.5) in the inverse of [[0.04, 0.03], [0.03, 0.04]]: 0.25 * 0.04 / (0.04² - 0.03²).
    assert np.allclose(np.ravel(nees), 0.01 / 0.0007)


def chi_square(share, degrees):
    return pytest.approx(2.0 * gammaincinv(degrees / 2.0, share))


def test_bounds_of_two_degrees_are_those_of_the_chi_square_too():
    assert NEES_BOUNDS[2] == (chi_square(0.025, 2), chi_square(0.975, 2))


def test_states_and_events_stand_at_their_times(tmp_path):
    chunks = review_of(tmp_path, "toy")
    time, states = column(chunks, "/state/toy", "StateChange")
    assert [state for (state,) in states][:3] == ["ACCEPT", "REJECT", "ACCEPT"]
    assert time[1] == np.timedelta64(500, "ms")
    _, texts = column(chunks, "/events/toy", "text")
    assert texts[0] == ["0.5 s  02:00:5e:00 rejected: gate, NIS 0.2"]
    assert len(texts) == 12


def test_folder_gets_a_base_and_a_layer_for_each_estimator_of_one_recording(tmp_path):
    run = run_of(tmp_path)
    base, toy, other = write_scene(tmp_path / "layers", run, with_counterfactual(run))
    assert [file.name for file in (base, toy, other)] == [
        "base.rrd",
        "toy.rrd",
        "toy without 02%3A00%3A5e%3A00.rrd",
    ]
    assert recordings([base, toy, other]) == {("fusion", f"test run {WORLD.hash[:12]}")}
    in_base, in_toy = chunks_of(base).keys(), chunks_of(toy).keys()
    assert {"/map/walls", "/map/truth/path", "/rssi/b", "/scores", "/cdf/grid"} <= in_base
    assert "/map/estimate/toy/path" in in_toy
    assert not in_base & in_toy


def test_layers_together_hold_what_one_file_holds(tmp_path):
    run = run_of(tmp_path)
    layers = write_scene(tmp_path / "layers", run, with_counterfactual(run))
    (single,) = write_scene(tmp_path / "one.rrd", run, with_counterfactual(run))
    assert {path for layer in layers for path in chunks_of(layer)} == set(chunks_of(single))


def test_counterfactual_has_a_track_errors_and_a_row_in_the_table_and_nothing_else(tmp_path):
    run = run_of(tmp_path)
    reviewed = with_counterfactual(run)
    *_, other = write_scene(tmp_path / "layers", run, reviewed)
    name = r"toy\ without\ 02\:00\:5e\:00"
    own = {path for path in chunks_of(other) if not path.startswith("/__")}
    parts = {f"/map/estimate/{name}/{part}" for part in ("path", "trail", "pose", "error")}
    assert own == parts | {f"/{place}/{name}" for place in ("map/legend", "error", "heading_error", "cdf/estimate")}
    assert "| toy without 02:00:5e:00 |" in markdown(drawings(run, reviewed))


def with_counterfactual(run):
    what_if = without_anchor(run, "02:00:5e:00")
    return [*scored(run, ["toy"]), counterfactual("toy", {}, what_if, 0)]


def recordings(files):
    from rerun.chunk import RrdReader

    return {(store.application_id, store.recording_id) for file in files for store in RrdReader(file).recordings()}


def test_run_without_truth_is_drawn_without_errors(tmp_path):
    chunks = review_of(tmp_path, "toy", with_truth=False)
    assert "/map/estimate/toy/path" in chunks
    assert not any(path.startswith(("/error", "/map/truth", "/map/legend/truth")) for path in chunks)


def test_estimator_without_answers_and_crashed_one_have_a_legend_and_no_track(tmp_path):
    chunks = review_of(tmp_path, "silent", "broken")
    assert not any(path.startswith(("/error", "/cdf/estimate", "/map/estimate/broken")) for path in chunks)
    assert not any(path.endswith(("/path", "/pose", "/error")) for path in chunks if path.startswith("/map/estimate"))
    assert {"/scores", "/map/legend/silent", "/map/legend/broken"} <= chunks.keys()


def test_score_table_ranks_the_live_first_and_reports_the_crash(tmp_path):
    run = run_of(tmp_path)
    lines = markdown(drawings(run, scored(run, ["broken", "toy"]))).splitlines()
    assert lines[0].endswith("| avail. | time | age | gaps |")
    assert lines[2].startswith("| toy | 50.0 |")
    assert lines[2].endswith(" | 0 |")
    assert lines[3].startswith("| broken (crashed) |")
    assert "on purpose" in lines[-1]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
def test_full_disk_is_one_error(tmp_path):
    run = run_of(tmp_path)
    reviewed = scored(run, ["toy"])
    (tmp_path / "review.rrd").symlink_to("/dev/full")
    with pytest.raises(FusionError, match=r"review\.rrd: cannot be written \(No space left on device\)"):
        write_scene(tmp_path / "review.rrd", run, reviewed)
    (tmp_path / "layers").mkdir()
    (tmp_path / "layers" / "toy.rrd").symlink_to("/dev/full")
    with pytest.raises(FusionError, match=r"toy\.rrd: cannot be written \(No space left on device\)"):
        write_scene(tmp_path / "layers", run, reviewed)


def test_answer_that_is_no_number_is_reported_beside_the_table_and_draws_no_error(tmp_path):
    with fusion.registered("poisoned", Poisoned):
        run = run_of(tmp_path)
        reviewed = scored(run, ["poisoned", "toy"])
    table = markdown(drawings(run, reviewed)).splitlines()
    row, note = table[3], table[-1]
    assert row.startswith("| poisoned (diverged) | – | – | ∞ |")
    assert note.startswith("poisoned diverged: it answers x nan m, y 0.5 m, heading 0 rad, 2 s after its first answer")
    (scene,) = write_scene(tmp_path / "review.rrd", run_of(tmp_path), reviewed)
    assert "/error/poisoned" not in chunks_of(scene)
    assert "/map/estimate/poisoned/path" in chunks_of(scene)


def test_place_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    run = run_of(tmp_path)
    with pytest.raises(FusionError, match="give another place"):
        write_scene(tmp_path / "file" / "review.rrd", run, scored(run, ["toy"]))


def test_every_built_in_has_a_colour_of_its_own_and_a_stranger_always_the_same():
    assert len(set(ESTIMATORS.values())) == len(ESTIMATORS)
    assert colour_of("somebody's") == colour_of("somebody's")


def test_long_tracks_are_thinned_and_short_ones_are_not():
    assert len(thinned(np.arange(100 * MOST_POSES + 1))) <= MOST_POSES
    assert len(thinned(np.arange(MOST_POSES))) == MOST_POSES


def test_only_a_track_that_jumps_counts_as_jumping():
    time_ns = np.arange(100) * SECOND_NS // 10
    steady = np.column_stack([0.1 * np.arange(100), np.zeros(100)])
    jumping = np.column_stack([3.0 * (np.arange(100) % 2), np.zeros(100)])
    assert not mostly_jumps(time_ns, steady)
    assert mostly_jumps(time_ns, jumping)
