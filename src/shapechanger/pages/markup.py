"""The little HTML that a report needs; text becomes `Html` only through `text`, which escapes it.

>>> element("p", text("1 < 2"), id="law")
'<p id="law">1 &lt; 2</p>'
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import NewType

__all__ = ["Html", "details", "element", "joined", "pairs", "paragraph", "pre", "table", "text"]

Html = NewType("Html", str)


def text(words: str) -> Html:
    """Text that stands for itself, whatever characters it holds."""
    return Html(html.escape(words, quote=True))


def joined(parts: Iterable[Html]) -> Html:
    """One piece of markup after another."""
    return Html("\n".join(parts))


def element(name: str, *inner: Html, **attributes: str) -> Html:
    """An element; `class_` is the attribute class, `data_label` is data-label."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{html.escape(value, quote=True)}"'
        for key, value in attributes.items()
    )
    return Html(f"<{name}{written}>{''.join(inner)}</{name}>")


def paragraph(words: str, **attributes: str) -> Html:
    """A paragraph of text."""
    return element("p", text(words), **attributes)


def pre(words: str) -> Html:
    """Text that keeps its lines."""
    return element("pre", text(words))


def details(summary: str, *inner: Html) -> Html:
    """Something folded in under its summary."""
    return element("details", element("summary", text(summary)), *inner)


def pairs(items: Iterable[tuple[str, Html]]) -> Html:
    """A list of terms, each with what belongs to it."""
    rows = (
        element("div", element("dt", text(term)), element("dd", content)) for term, content in items
    )
    return element("dl", *rows)


def table(
    caption: str, header: Sequence[str], rows: Iterable[Sequence[Html]], *, class_: str = ""
) -> Html:
    """A table whose first column names the row; each cell knows its column, for narrow screens."""
    head = element("tr", *(element("th", text(name), scope="col") for name in header))
    body = (
        element(
            "tr",
            element("th", cells[0], scope="row"),
            *(
                element("td", cell, data_label=name)
                for name, cell in zip(header[1:], cells[1:], strict=True)
            ),
        )
        for cells in rows
    )
    return element(
        "table",
        element("caption", text(caption)),
        element("thead", head),
        element("tbody", *body),
        **({"class_": class_} if class_ else {}),
    )
