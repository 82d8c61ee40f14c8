"""A page that is written as Markdown, as one HTML file that needs no network."""

from __future__ import annotations

import base64
import html

from fusion import FusionError

STYLE = """
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 72rem; margin: 0 auto; padding: 1rem; }
table { display: block; overflow-x: auto; border-collapse: collapse; font-size: 0.85rem; margin: 0.5rem 0 1.5rem; }
th, td { border-bottom: 1px solid #8884; padding: 0.25rem 0.6rem; vertical-align: top; }
th { text-align: left; }
img { max-width: 100%; background: white; }
td[style*="right"] { white-space: nowrap; }
code { font-size: 0.9em; }
"""


def as_html(title: str, markdown: str) -> bytes:
    """The page, readable on a phone; pictures in it should be linked to by `inline_png`. Raises `FusionError`."""
    try:
        from markdown_it import MarkdownIt
    except ImportError as error:
        raise FusionError("HTML pages need markdown-it-py; pip install 'fusion-localization[plots]'") from error
    body = MarkdownIt("commonmark").enable("table").render(markdown)
    viewport = '<meta charset="utf-8"><meta name="viewport" content="width=device-width">'
    head = f"<head>{viewport}<title>{html.escape(title)}</title><style>{STYLE}</style></head>"
    return f'<!doctype html><html lang="en">{head}<body>{body}</body></html>\n'.encode()


def inline_png(picture: bytes) -> str:
    """A PNG as an address that holds it."""
    return "data:image/png;base64," + base64.b64encode(picture).decode()
