"""The figures as tables: on a terminal, and in `docs/performance.md`."""

from __future__ import annotations

from collections.abc import Iterable

from benchmarks.performance.agreement import Answer
from benchmarks.performance.cost_laws import Law
from benchmarks.performance.perf import Performance
from benchmarks.performance.row import Row
from fusion.output.tables import Table, as_markdown

TITLE = "# The speed that `fusion perf` measured"
HEAD = ("best", "median", "ratio", "against", "floor", "held")


def tables(measured: Performance) -> list[Table]:
    """Answers, one table for each quantity, and the laws."""
    by_quantity: dict[tuple[str, str], list[Row]] = {}
    laws = {law.name for law in measured.laws}
    for row in measured.rows:
        if row.quantity not in laws:
            by_quantity.setdefault((row.quantity, row.unit), []).append(row)
    each = [_quantity(*key, rows) for key, rows in by_quantity.items()]
    return [_answers(measured.answers), *each, _laws(measured)]


def markdown(measured: Performance) -> str:
    """All tables, after the conditions that they were measured under."""
    about = "; ".join(f"{key} {value}" for key, value in measured.conditions.items())
    missing = "" if measured.missing is None else f"{measured.missing}.\n\n"
    return (
        f"{TITLE}\n\n{about}.\n\n{missing}{verdict(measured)}.\n\n"
        + "\n\n".join(map(as_markdown, tables(measured)))
        + "\n"
    )


def verdict(measured: Performance) -> str:
    """A sentence: how many floors are held, and which are not."""
    judged = [row for row in measured.rows if row.holds is not None]
    below = [f"{row.subject}: {row.quantity}" for row in judged if not row.holds]
    held = f"{len(judged) - len(below)} of {len(judged)} floors are held"
    return f"{held}; not: {'; '.join(below)}" if below else held


def _answers(answers: Iterable[Answer]) -> Table:
    rows = tuple((one.name, f"{100.0 * one.rmse_m:.1f}", _apart(one)) for one in answers)
    return Table("Answers", ("", "position RMSE cm", "apart from filterpy's EKF"), rows)


def _apart(answer: Answer) -> str:
    return "another model or method" if answer.apart is None else f"{answer.apart:.0e}"


def _quantity(quantity: str, unit: str, rows: Iterable[Row]) -> Table:
    return Table(f"{quantity[0].upper()}{quantity[1:]} [{unit}]", ("", *HEAD), tuple(map(_row, rows)))


def _row(row: Row) -> tuple[str, ...]:
    return (
        row.subject,
        number(row.value),
        "–" if row.median is None else number(row.median),
        "–" if row.ratio is None else f"{number(row.ratio)}x",
        row.against or "–",
        _floor(row),
        {True: "yes", False: "no", None: "–"}[row.holds],
    )


def _floor(row: Row) -> str:
    if row.floor is None:
        return "–"
    return f"{row.floor.sense.value} {row.floor.bound:g}{'' if row.floor.of_value else 'x'}"


def _laws(measured: Performance) -> Table:
    rows = {row.quantity: row for row in measured.rows}
    head = ("cost by ...", "unit", "at", "costs", "per one more", "last / first", "floor", "held")
    return Table("Cost laws", head, tuple(_law(law, rows[law.name]) for law in measured.laws), prose=True)


def _law(law: Law, row: Row) -> tuple[str, ...]:
    points = ", ".join(f"{point:g}" for point in law.points)
    costs = ", ".join(number(cost.least) for cost in law.costs)
    *_, ratio, _against, floor, holds = _row(row)
    return f"{law.name} ({law.subject})", law.unit, points, costs, number(law.line[0]), ratio, floor, holds


def number(value: float) -> str:
    """Three digits that count.

    >>> [number(value) for value in (0.00123, 0.1234, 1.234, 12.34, 1234.5)]
    ['0.00123', '0.123', '1.23', '12.3', '1234']
    """
    return f"{value:.0f}" if abs(value) >= 100.0 else f"{value:.3g}"
