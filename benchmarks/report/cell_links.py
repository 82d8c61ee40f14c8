"""Every cell of a suite as an entry of its report: where the numbers lead, with the command that shows the moment."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

from benchmarks.report.report_data import ReportData
from benchmarks.report.worst import command
from benchmarks.runner.results import Result
from benchmarks.runner.suite import CLEAN, TUNE

SCRIPT = """
function offerCopy(code) {
  const button = document.createElement("button");
  button.textContent = "copy";
  button.onclick = () => {
    getSelection().selectAllChildren(code);
    button.textContent = document.execCommand("copy") ? "copied" : "press Ctrl-C";
  };
  code.before(button);
}
document.querySelectorAll("li > code").forEach(offerCopy);
function reveal() {
  const entry = document.getElementById(location.hash.slice(1));
  const fold = entry && entry.closest("details");
  if (fold) {
    fold.open = true;
    entry.scrollIntoView({ block: "center" });
  }
}
addEventListener("hashchange", reveal);
reveal();
"""
"""Buttons that mark a command and copy it (the clipboard proper may be refused to a page from a file), and the
unfolding of what a link leads to, for browsers that do not do it. Without it the page shows the same.
"""


def nearest(results: Sequence[Result], metric: str, value: float) -> Result:
    """The cell that has this value of a metric, or the next to it: where a median comes from."""
    values = [result.metrics.get(metric, math.inf) for result in results]
    return results[nearest_to([math.inf if math.isnan(own) else own for own in values], value)]


def nearest_to(values: Sequence[float], value: float) -> int:
    """The place of the number nearest to ``value``; all may be infinite."""
    return min(range(len(values)), key=lambda k: 0.0 if values[k] == value else abs(values[k] - value))


def link(data: ReportData, text: str, result: Result) -> str:
    """A number, in Markdown, that leads to the entry of a cell."""
    return text if text == "–" else f"[{text}](#{data.anchor(result)})"


def link_all(data: ReportData, text: str, estimator: str) -> str:
    """The same to all cells of an estimator."""
    return text if text == "–" else f"[{text}](#{data.anchor_of_all(estimator)})"


def entries(data: ReportData) -> str:
    """All cells, folded by estimator, the best first: HTML without an empty line, one block to Markdown."""
    grouped: dict[str, list[Result]] = {name: [] for name in data.estimators}
    for result in data.results:
        grouped[result.cell.estimator.id].append(result)
    return "\n".join(_fold(data, name, own) for name, own in grouped.items())


def counted(count: int, what: str) -> str:
    """A number of things.

    >>> counted(1, "run"), counted(0, "fault")
    ('1 run', 'no faults')
    """
    return f"{count or 'no'} {what}{'' if count == 1 else 's'}"


def _fold(data: ReportData, name: str, own: Sequence[Result]) -> str:
    title = html.escape(f"{name}: {counted(len(own), 'cell')}")
    head = f'<details id="{data.anchor_of_all(name)}"><summary>{title}</summary><ul>'
    return "\n".join([head, *(_entry(data, result) for result in own), "</ul></details>"])


def _entry(data: ReportData, result: Result) -> str:
    cell = result.cell
    where = [cell.run.id + (" (tune)" if cell.run.split == TUNE else "")]
    where += [] if cell.fault.id == CLEAN else [cell.fault.id]
    where += [f"seed {cell.seed}"] if data.suite.seeds > 1 else []
    facts = [result.status]
    if data.metric in result.metrics:
        facts.append(f"{data.metric} {data.text(result.metrics[data.metric])}")
    if result.worst_at_s is not None:
        facts.append(f"worst error {100.0 * result.metrics['pos_max']:.0f} cm at {result.worst_at_s:.1f} s")
    title = html.escape(f"{', '.join(where)}: {', '.join(facts)}")
    return f'<li id="{data.anchor(result)}">{title}<br><code>{html.escape(command(result, data.words))}</code></li>'
