"""Self-contained HTML pages: templates, and images as data URIs."""

from __future__ import annotations

import base64
import functools
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import needing_extra
from shapechanger.reports.numbers import count, duration_text, shares_text

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = Path(__file__).parent / "templates"


def render(template: str | Path, **values: Any) -> str:
    """Render a page from a template, which may import from `shapechanger/reports/templates`.

    Values are escaped, except those of type `markupsafe.Markup`.
    """
    path = _TEMPLATES / template
    return _environment(path.parent).get_template(path.name).render(values)


@functools.cache
def _environment(folder: Path) -> Environment:
    with needing_extra("report"):
        from jinja2 import Environment, FileSystemLoader, StrictUndefined
    environment = Environment(
        loader=FileSystemLoader([folder, _TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    cast("Any", environment).filters.update(
        count=count,
        decimal="{:.1f}".format,
        duration=duration_text,
        jpeg=jpeg_uri,
        png=png_uri,
        shares=shares_text,
        svg=svg_uri,
    )
    return environment


def png_uri(picture: NDArray[np.uint8]) -> str:
    """Return an image of shape (height, width, 3) as a lossless data URI."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(picture).save(file, "png", optimize=True)
    return _uri("image/png", file.getvalue())


def jpeg_uri(jpeg: bytes) -> str:
    """Return a JPEG file as a data URI."""
    return _uri("image/jpeg", jpeg)


def svg_uri(svg: str) -> str:
    """Return an SVG drawing as a data URI, so that its ids cannot clash with other drawings."""
    return _uri("image/svg+xml", svg.encode())


def _uri(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
