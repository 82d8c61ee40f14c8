"""The page a researcher can cite: `page.md` with its tables and figures put in, as Markdown or as one HTML file."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path

from benchmarks.paper.assumptions import MAIN, PREMISE
from benchmarks.paper.claims import in_words
from benchmarks.paper.figures import FIGURES
from benchmarks.paper.interpretations import literal
from benchmarks.paper.published import EKF
from benchmarks.paper.report import Report
from benchmarks.paper.tables import beating, filling_curves
from fusion.output.figures import as_png, require_matplotlib
from fusion.output.files import write
from fusion.output.html import as_html, inline_png
from fusion.output.tables import as_markdown

PLACE = re.compile(r"\{\{(table|figure|text) (\w+)\}\}")


def markdown(report: Report, figure_link: Callable[[str], str]) -> str:
    """The page, with figures linked to by ``figure_link``."""
    text = resources.files("benchmarks").joinpath("paper", "page.md").read_text(encoding="utf-8")

    sentences = texts(report)

    def filled(place: re.Match[str]) -> str:
        kind, name = place.groups()
        if kind == "table":
            return as_markdown(report.tables[name])
        if kind == "figure":
            return f"![{(FIGURES[name].__doc__ or name).splitlines()[0]}]({figure_link(name)})"
        return sentences[name]

    return PLACE.sub(filled, text)


def texts(report: Report) -> dict[str, str]:
    """Sentences that hang on the numbers."""
    nearest = report.ranked[0]
    return {
        "trials": str(len(report.outcomes[0].seeds)),
        "seeds": f"{report.outcomes[0].seeds[0]} to {report.outcomes[0].seeds[-1]}",
        "verdict": in_words(report.judged),
        "answer": answer(report),
        "factors": ", ".join(
            f"{outcome.environment.short} {outcome.scenario.calibration['odometry_factor']}"
            for outcome in report.outcomes
        ),
        "nearest": (
            f"Of {len(report.ranked)} interpretations the closest to the published maxima takes outliers in percent "
            f"{nearest.interpretation}: off by a mean factor of {nearest.factor:.2f}."
        ),
    }


def answer(report: Report) -> str:
    """Does the claim hold, and when does it break: how often the method beats both, here and where it does best."""

    def beats(curve: str, key: str) -> str:
        shares = []
        for outcome in report.outcomes:
            curves = filling_curves(outcome, key)
            shares.append(f"{outcome.environment.short} {beating(curves, curve)}")
        return ", ".join(shares)

    read, loose = literal().scale, "travelled"
    return (
        f"How often the method beats both odometry and Wi-Fi: read literally, {beats(read, MAIN.key)}; where Wi-Fi is "
        f"accurate but for outliers, the premise of the paper's section III-A, {beats(read, PREMISE.key)}; there, with "
        f"the ten percent taken of the distance travelled, {beats(loose, PREMISE.key)}. The EKF on the same runs: "
        f"{beats(EKF, MAIN.key)}; {beats(EKF, PREMISE.key)}."
    )


def write_markdown(report: Report, path: Path) -> list[Path]:
    """The page at ``path``, its figures beside it as ``<stem>-<figure>.png``; raises `FusionError`."""
    require_matplotlib()
    figures = {name: path.with_name(f"{path.stem}-{name}.png") for name in FIGURES}
    write(path, markdown(report, lambda name: figures[name].name).encode())
    for name, place in figures.items():
        write(place, _drawn(report, name))
    return [path, *figures.values()]


def write_html(report: Report, path: Path) -> None:
    """One self-contained file; raises `FusionError`."""
    require_matplotlib()
    write(
        path,
        as_html("Hybrid localization, reproduced", markdown(report, lambda name: inline_png(_drawn(report, name)))),
    )


def _drawn(report: Report, name: str) -> bytes:
    return as_png(FIGURES[name](report.outcomes))


def write_png(report: Report, path: Path) -> None:
    """The paper's three result figures; raises `FusionError`."""
    require_matplotlib()
    write(path, _drawn(report, "errors"))
