"""The page of refusals, compared with the exceptions of the code."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import shapechanger.morphology

_CODE = Path(shapechanger.morphology.__file__).parent
_PAGE = Path(__file__).parents[2] / "docs" / "refusals.md"


def _raised() -> Iterator[str]:
    """Yield the message of every refusal of edits, with `…` for values."""
    for path in (*_CODE.glob("edits/*.py"), *_CODE.glob("spec/*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)):
                continue
            if isinstance(node.exc.func, ast.Name) and node.exc.func.id == "MorphologyError":
                (message,) = node.exc.args
                parts = message.values if isinstance(message, ast.JoinedStr) else [message]
                yield "".join(str(p.value) if isinstance(p, ast.Constant) else "…" for p in parts)


def test_every_refusal_has_its_row() -> None:
    """The page lists each sentence once, and no sentence that the code has not."""
    rows = re.findall(r"^\| `(.*?)` \|", _PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(rows) == len({*rows})
    assert {*rows} == {*_raised()}
