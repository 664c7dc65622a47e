"""Shared parts of the commands that push to the Hugging Face Hub: options and README."""

from __future__ import annotations

from textwrap import indent
from typing import Annotated

import tyro

from shapechanger.layout import Layout

RepoName = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="REPO")]
Public = Annotated[
    bool, tyro.conf.arg(help="Make a new repository public; it is private if not given.")
]
Revision = Annotated[
    str, tyro.conf.arg(help="Commit, branch or tag; the newest commit if not given.")
]


def features_text(layout: Layout | None, more: str = "") -> str:
    """Return the features of a layout with their units, in Markdown; `more` without a layout."""
    if layout is None:
        return more
    return f"{layout.size} numbers: " + ", ".join(f"`{feature}`" for feature in layout)


def readme(
    repo: str,
    tags: list[str],
    lead: str,
    rows: dict[str, object],
    layouts: dict[str, str],
    command: str,
    usage: str,
) -> str:
    """Return a README for the Hub, with a YAML header."""
    cells = {name: " ".join(str(value).replace("|", "\\|").split()) for name, value in rows.items()}
    table = "\n".join(f"| {name} | {cell} |" for name, cell in cells.items())
    parts = [
        "---\nlibrary_name: shapechanger\ntags:\n"
        + "".join(f"- {tag}\n" for tag in ("shapechanger", "robotics", *tags))
        + "---",
        f"# {repo}",
        lead,
        f"| | |\n| --- | --- |\n{table}",
        *(f"**{name}**: {features}" for name, features in layouts.items()),
    ]
    for title, code in (("Made by", command), ("Use it", usage)):
        if code:
            parts += [title, indent(code, "    ")]
    return "\n\n".join(parts) + "\n"
