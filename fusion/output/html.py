"""A page that is written as Markdown, as one HTML file that needs no network."""

from __future__ import annotations

import base64
import html
import json
from typing import Any

from fusion.errors import FusionError

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem;
  overflow-wrap: break-word; }
table { display: block; overflow-x: auto; border-collapse: collapse; font-size: 0.85rem; margin: 0.5rem 0 1.5rem; }
th, td { border-bottom: 1px solid #8884; padding: 0.25rem 0.6rem; vertical-align: top; }
th { text-align: left; }
img { max-width: 100%; background: white; }
td[style*="right"], td:not(:last-child) { white-space: nowrap; }
tr > td:first-child { white-space: normal; overflow-wrap: anywhere; min-width: 8rem; }
code { font-size: 0.9em; overflow-wrap: anywhere; }
td code { display: block; min-width: 36rem; }
.figures { display: flex; flex-wrap: wrap; gap: 1rem; align-items: start; }
.figure { position: relative; flex: 0 1 21rem; }
.figure img { display: block; width: 100%; touch-action: manipulation; }
.figure small { display: block; min-height: 3em; font-size: 0.8rem; }
.figure i { position: absolute; width: 1rem; height: 1rem; margin: -0.5rem; border: 2px solid black; border-radius: 50%;
  box-sizing: border-box; pointer-events: none; }
li { margin: 0.4rem 0; }
summary { cursor: pointer; padding: 0.25rem 0; }
:target { outline: 2px solid #0072b2; outline-offset: 0.25rem; }
button { font: inherit; font-size: 0.8em; margin-right: 0.5rem; }
a { color: light-dark(#0072b2, #56b4e9); }
"""


DATA, END = '<script type="application/json" id="data">', "</script>"
"""Frame of a page around its numbers; inside, `<` is escaped."""


def as_html(title: str, markdown: str, script: str = "", data: object = None) -> bytes:
    """The page, readable on a phone; pictures in it should be linked to by `inline_png`, and it must make sense without
    its ``script``. ``data``: numbers for programs, which `data_of` reads again. Raises `FusionError`.
    """
    try:
        from markdown_it import MarkdownIt
    except ImportError as error:
        raise FusionError("HTML pages need markdown-it-py; pip install 'fusion-localization[plots]'") from error
    body = MarkdownIt("commonmark").enable("table").render(markdown)
    viewport = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    run = f"<script>{script}</script>" if script else ""
    head = f"<head>{viewport}<title>{html.escape(title)}</title><style>{STYLE}</style></head>"
    numbers = "" if data is None else DATA + json.dumps(data, allow_nan=False).replace("<", r"\u003c") + END
    return f'<!doctype html><html lang="en">{head}<body>{body}{numbers}{run}</body></html>\n'.encode()


def data_of(page: str) -> Any:  # noqa: ANN401 - whatever was written
    """The ``data`` of a page; raises `ValueError` when it holds none.

    >>> data_of(as_html("t", "text", data={"a": [1.5, "</script>"]}).decode())
    {'a': [1.5, '</script>']}
    """
    _, found, rest = page.partition(DATA)
    if not found:
        raise ValueError("the page holds no numbers")
    return json.loads(rest.partition(END)[0])


def inline_png(picture: bytes) -> str:
    """A PNG as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(picture).decode()
