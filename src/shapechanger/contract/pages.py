"""Pages of envs: docstrings, which inherit the sections that they lack."""

from __future__ import annotations

import inspect
import re
from typing import Any, Final

_TITLES: Final = (
    *("Action space", "Observation space", "Reward", "Start", "End", "Info", "On a rig"),
    *("Arguments", "Common arguments", "Versions"),
)
_PACKAGE: Final = "shapechanger."  # Gymnasium's pages have other headings.
_TAIL: Final = re.compile(r"^(?=(?:Args|Attributes|Raises):$)", re.MULTILINE)


class Page:
    """Mixin of envs whose docstrings are pages: sections with a heading of `_TITLES` each.

    A page without one of these sections has that of its nearest base class, so that an env and its
    robot, or all bodies of a task, cannot describe the same space or argument differently.
    """

    def __init_subclass__(cls, **more: Any) -> None:
        """Add the sections that the docstring lacks."""
        super().__init_subclass__(**more)
        begin, sections, end = _parts(vars(cls).get("__doc__"))
        for base in cls.__mro__[1:]:
            if sections and base.__module__.startswith(_PACKAGE):
                sections = _parts(vars(base).get("__doc__"))[1] | sections
        if sections:
            texts = [f"## {title}\n{sections[title]}" for title in _TITLES if title in sections]
            cls.__doc__ = "\n\n".join(part for part in (begin, *texts, end) if part)


def _parts(page: str | None) -> tuple[str, dict[str, str], str]:
    """Return the text before the first section, the sections by title, and `Args` and the rest."""
    body, *end = _TAIL.split(inspect.cleandoc(page or ""), maxsplit=1)
    begin, *texts = re.split(r"^## ", body, flags=re.MULTILINE)
    sections = dict(text.split("\n", 1) for text in texts)
    return begin.rstrip(), {title: text.strip() for title, text in sections.items()}, "".join(end)
