"""A whole page, as text."""

from __future__ import annotations

from importlib.resources import files
from typing import Final

from shapechanger.pages.markup import Html, text

__all__ = ["page_text"]

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
    common = files("shapechanger.pages").joinpath("page.css").read_text("utf-8")
    return _PAGE.format(title=text(title), style=common + style, body=body)
