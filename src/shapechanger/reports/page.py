"""The little HTML that a report needs; text becomes `Html` only through `text`, which escapes it.

>>> element("p", text("1 < 2"), id="law")
'<p id="law">1 &lt; 2</p>'
"""

from __future__ import annotations

import base64
import html
import struct
import zlib
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Final, NewType

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Html",
    "details",
    "element",
    "joined",
    "page_text",
    "pairs",
    "paragraph",
    "png",
    "png_uri",
    "pre",
    "svg_uri",
    "table",
    "text",
]

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


_PAGE: Final = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
{body}
</body>
</html>
"""


def page_text(title: str, body: Html, style: str = "") -> str:
    """A page that looks as all of ours.

    Args:
        title: What it is called.
        body: What is on it.
        style: CSS of its own, besides what all have.
    """
    common = files("shapechanger.reports").joinpath("page.css").read_text("utf-8")
    return _PAGE.format(title=text(title), style=common + style, body=body)


_SIGNATURE: Final = b"\x89PNG\r\n\x1a\n"
# Bits of a channel; red, green and blue; then the only compression and filter there are; no
# interlacing. Source of the format: ISO/IEC 15948.
_RGB8: Final = bytes([8, 2, 0, 0, 0])
_UP: Final = 2  # The filter that keeps of each row what differs from the row above.


def png(picture: NDArray[np.uint8]) -> bytes:
    """A picture, shape (height, width, 3), as a PNG file."""
    height, width, _ = picture.shape
    above = np.concatenate([np.zeros_like(picture[:1]), picture[:-1]])
    rows = (picture - above).reshape(height, -1)  # Bytes wrap around, as the filter wants it.
    filters = np.full((height, 1), _UP, np.uint8)
    return b"".join(
        (
            _SIGNATURE,
            _chunk(b"IHDR", struct.pack(">II", width, height) + _RGB8),
            _chunk(b"IDAT", zlib.compress(np.hstack([filters, rows]).tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def png_uri(picture: NDArray[np.uint8]) -> str:
    """A picture, shape (height, width, 3), without loss."""
    return _uri("image/png", png(picture))


def svg_uri(svg: str) -> str:
    """A drawing; as an image of its own, so that the ids of two drawings do not meet."""
    return _uri("image/svg+xml", svg.encode())


def _chunk(kind: bytes, content: bytes) -> bytes:
    check = zlib.crc32(kind + content)
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
