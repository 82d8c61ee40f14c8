"""A table of texts that can be printed, put into a Markdown page and into an HTML page, always saying the same."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import IO, TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from rich.console import Console

WIDTH = 120
"""Columns of a table that goes into a file or a pipe."""


class Table(NamedTuple):
    """``head`` names the columns. The first names the rows, the others hold numbers, or ``prose`` that stands left."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    prose: bool = False


def console(file: IO[str] | None = None) -> Console:
    """The console for tables: as wide as the terminal, or `WIDTH`."""
    from rich.console import Console

    made = Console(file=file or sys.stdout)
    if not made.is_terminal:
        made.width = WIDTH
    return made


def print_tables(tables: Sequence[Table], file: IO[str] | None = None) -> None:
    """For a terminal, or a file of 120 columns."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table as Grid

    output = console(file)
    for table in tables:
        # What stands in brackets, as a unit may, is text and no markup.
        grid = Grid(title=escape(table.title), box=SIMPLE_HEAD, title_justify="left", pad_edge=False)
        for place, title in enumerate(table.head):
            grid.add_column(escape(title), justify="left" if place == 0 or table.prose else "right")
        for row in table.rows:
            grid.add_row(*map(escape, row))
        output.print(grid)


def as_markdown(table: Table) -> str:
    r"""A pipe table under its title in bold.

    >>> print(as_markdown(Table("Sizes", ("what", "m"), (("a|b", "<1"),))))
    **Sizes**
    <BLANKLINE>
    | what | m |
    |---|--:|
    | a\|b | &lt;1 |
    """
    rules = ["---", *(["---" if table.prose else "--:"] * (len(table.head) - 1))]
    lines = [_row(table.head), "|" + "|".join(rules) + "|", *map(_row, table.rows)]
    return f"**{table.title}**\n\n" + "\n".join(lines)


def as_code(text: str) -> str:
    """``text`` as it stands, in Markdown, whatever it holds: a plug-in's error is no markup.

    >>> as_code("no `x`; *none* at all")
    "`no 'x'; *none* at all`"
    """
    return "`" + text.replace("`", "'") + "`"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("<", "&lt;").replace("|", "\\|").replace("\n", " ") for cell in cells) + " |"
