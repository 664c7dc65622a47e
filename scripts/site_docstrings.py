"""Griffe extension of the site: docstrings as Markdown expects them."""

from __future__ import annotations

import re
from typing import Any, Final

import griffe

_EXAMPLE: Final = re.compile(r"(?:^>>> .*\n?(?:^(?!$).*\n?)*)+", re.MULTILINE)


class FencedExamples(griffe.Extension):
    """Put the examples of docstrings into fences; in Markdown `>>>` would quote them."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        """Rewrite the docstrings of a package that Griffe has loaded, and of all that is in it."""
        self._rewrite(pkg)

    def _rewrite(self, obj: griffe.Object) -> None:
        for member in obj.members.values():
            if not isinstance(member, griffe.Alias):
                self._rewrite(member)
        if obj.docstring is not None:
            obj.docstring.value = fenced(obj.docstring.value)


def fenced(docstring: str) -> str:
    """Return a docstring with its examples in fences."""
    return _EXAMPLE.sub(lambda match: f"```pycon\n{match[0].rstrip()}\n```\n", docstring)
