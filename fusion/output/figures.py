"""Common parts of our pictures by matplotlib: panels in a row, plain axes, the colours of the review."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING

from fusion.errors import FusionError
from fusion.output.colours import Colour, colour_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

DOTS_PER_INCH = 110
PANEL_INCHES = 4.2


def require_matplotlib() -> None:
    """Raises `FusionError` with the remedy where it is missing."""
    try:
        import matplotlib  # noqa: F401 - asked for
    except ImportError as error:
        raise FusionError("figures need matplotlib; pip install 'fusion-localization[plots]'") from error


def panels(count: int, height: float, *, sharey: bool = False, columns: int = 6) -> tuple[Figure, list[Axes]]:
    """``count`` axes, ``height`` inches tall, at most ``columns`` in a row; no global state of pyplot, so nothing has
    to be closed.
    """
    from matplotlib.figure import Figure

    across = min(count, columns)
    down = -(-count // across)
    figure = Figure(figsize=(PANEL_INCHES * across, height * down), layout="constrained")
    every = list(figure.subplots(down, across, sharey=sharey, squeeze=False).flat)
    for unused in every[count:]:
        unused.remove()
    return figure, every[:count]


def label(axes: Axes, title: str, x: str, y: str) -> None:
    """Title and axes, on a light grid."""
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.grid(visible=True, color="0.9")
    axes.spines[["top", "right"]].set_visible(False)


def plain_ticks(axis: Axis, subs: tuple[float, ...] = (1.0, 2.0, 5.0)) -> None:
    """1, 2, 5, 10, ... on a logarithmic axis, written out; ``subs``: which digits of each decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def plain_colour(estimator: str) -> tuple[float, float, float]:
    """The estimator's colour in every picture, from 0 to 1."""
    return plain(colour_of(estimator))


def plain(colour: Colour) -> tuple[float, float, float]:
    """A colour of the review, from 0 to 1."""
    red, green, blue = colour
    return red / 255.0, green / 255.0, blue / 255.0


def as_png(figure: Figure) -> bytes:
    """The picture, the same bytes for the same figure and version of matplotlib."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    buffer = BytesIO()
    figure.set_dpi(DOTS_PER_INCH)
    # Not by `savefig`, which draws everything once more only to lay it out.
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None})  # type: ignore[no-untyped-call]
    return buffer.getvalue()
