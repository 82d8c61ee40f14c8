"""A run and its estimators as Rerun files: a base layer of what belongs to the run, and a layer for each estimator.

All layers name the same application and recording, so the viewer shows those it is given as one recording: `rerun
base.rrd ekf.rrd`. Nothing but drawing happens here: the numbers are those of the bench.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any
from urllib.parse import quote

from benchmarks.metrics.catalogue import COLUMNS, column
from benchmarks.review.base_layer import draw_base, properties
from benchmarks.review.blueprint import blueprint
from benchmarks.review.canvas import Canvas
from benchmarks.review.cdf import CdfAxes, draw_curve
from benchmarks.review.drawing import Drawing, drawings, entry_of
from benchmarks.review.estimator_layer import draw_on_map, thickness
from benchmarks.review.estimator_plots import draw_over_time
from benchmarks.review.folding import Reviewed
from benchmarks.review.frame import Frame
from benchmarks.review.listing import line
from benchmarks.review.moments import worst_moments
from benchmarks.review.radio_circles import ReadingColumns
from benchmarks.review.viewer import require_rerun
from benchmarks.runner.leaderboard import COST_COLUMN, leaderboard
from fusion.output.files import require_place, write
from fusion.output.tables import as_markdown
from logs.run import Run

AGES = (column("age_p95", "age"), column("dropouts", "gaps"))
"""Age of the newest answer at 95 % of the instants [s], and the number of gaps without one."""
APPLICATION = "fusion"
SUFFIX = ".rrd"


def write_scene(output: Path, run: Run, reviewed: Sequence[Reviewed]) -> list[Path]:
    """Write the review of ``run``, which brings its own layout.

    ``output``: one file when its name ends in ``.rrd``, else a folder for ``base.rrd`` and a file for each estimator.
    Answers the files, which are to be opened together. Raises `ViewerError` where Rerun is not installed,
    `FusionError` where a file cannot be written.
    """
    rr = require_rerun()
    base, layers = files(output, [one.name for one in reviewed])
    frame, drawn = Frame.around(run), drawings(run, reviewed)
    readings = ReadingColumns.of_run(run.world, run.measurements)
    axes, legend = _axes(drawn), frame.legend(1 + len(drawn))
    identity = f"{run.name} {run.world.hash[:12]}"
    with _recording(base, identity, blueprint(frame, run, drawn)) as recording:
        recording.send_recording_name(run.name)
        recording.send_property("run", rr.AnyValues(**properties(run, frame)))
        canvas = Canvas(rr, recording, frame.start_ns, frame.timelines)
        draw_base(canvas, run, frame, readings, axes, legend[0])
        text = markdown(drawn) + _worst(run, drawn, frame.start_ns)
        canvas.style(["scores"], rr.TextDocument(text, media_type="text/markdown"))
        for drawing, place in zip(drawn, legend[1:], strict=True):
            with _recording(layers[drawing.name], identity) if layers else nullcontext(recording) as own:
                layer = canvas._replace(recording=own)
                draw_on_map(layer, run.world, readings, drawing, place)
                draw_over_time(layer, run.world, frame, drawing)
                if axes is not None:
                    draw_curve(layer, drawing, axes, thickness(drawing))
    return [base, *layers.values()]


def files(output: Path, names: Sequence[str]) -> tuple[Path, Mapping[str, Path]]:
    """The file of the base layer, and those of the estimators by name: none where all is in one file."""
    if output.suffix == SUFFIX:
        return output, {}
    # A name may hold what a file system cannot: "ekf without 02:00:5e:00".
    return output / f"base{SUFFIX}", {name: output / f"{quote(name, safe=' ')}{SUFFIX}" for name in names}


@contextmanager
def _recording(output: Path, identity: str, layout: Any = None) -> Iterator[Any]:  # noqa: ANN401 - Rerun's own values
    """A recording that is written into the file ``output``; the one with the layout alone carries the properties."""
    require_place(output)
    rr = require_rerun()
    recording = rr.RecordingStream(APPLICATION, recording_id=identity, send_properties=layout is not None)
    # Not by Rerun's own writer, a thread that ends on a full disk and lets others wait for it for ever.
    memory = recording.memory_recording()
    if layout is not None:
        recording.send_blueprint(layout, make_active=False)
    try:
        yield recording
    finally:
        content = memory.drain_as_bytes()
    write(output, content)


def _axes(drawn: Sequence[Drawing]) -> CdfAxes | None:
    """Axes for the estimators that are shown; None without truth."""
    errors = [drawing.score.errors.position for drawing in drawn if drawing.shown and drawing.score.errors is not None]
    return CdfAxes.around(errors) if errors else None


def _worst(run: Run, drawn: Sequence[Drawing], start_ns: int) -> str:
    """The worst moment of each estimator that is shown, as a list; empty where nothing is judged."""
    shown = [drawing for drawing in drawn if drawing.shown and not drawing.is_counterfactual]
    moments = [moment for drawing in shown for moment in worst_moments(run, drawing, start_ns, 1)]
    return "".join(["\nWorst moments\n\n", *(f"- {line(moment)}\n" for moment in moments)]) if moments else ""


def markdown(drawn: Sequence[Drawing]) -> str:
    """The table of scores, the best first, and why an estimator is missing from it. Its place is narrow, and the view's
    name states the units.
    """
    table = leaderboard("", [entry_of(drawing.reviewed) for drawing in drawn], (*COLUMNS, COST_COLUMN, *AGES))
    head = ("estimator", *(title.partition("\n")[0] for title in table.head[1:]))
    _, _, text = as_markdown(table._replace(head=head)).partition("\n\n")
    ends = [(drawing.name, drawing.score.end) for drawing in drawn]
    lost = [f"\n{name} {end.status}: {end.error}" for name, end in ends if end.error is not None]
    return "\n".join([text, *lost]) + "\n"
