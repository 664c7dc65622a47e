"""The page `docs/refusals.md` quotes every message with which an edit is refused."""

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


def _rules() -> list[list[str]]:
    """Return the quoted words of each row of the page but the last, an `UnknownName`."""
    rows = [line.split("|") for line in _PAGE.read_text(encoding="utf-8").splitlines()]
    return [re.findall("`(.+?)`", row[3]) for row in rows if len(row) == 6][2:-1]


def test_every_refusal_has_its_rule() -> None:
    """Exactly one row of the page quotes words of each message in the code."""
    rules = _rules()
    for sentence in {*_raised()}:
        found = [phrases for phrases in rules if any(each in sentence for each in phrases)]
        assert len(found) == 1, sentence


def test_every_rule_has_its_refusal() -> None:
    """All words that the page quotes are in a message, and the page is shorter than 30 lines."""
    sentences = {*_raised()}
    for each in (phrases for rule in _rules() for phrases in rule):
        assert any(each in sentence for sentence in sentences), each
    assert len(_PAGE.read_text(encoding="utf-8").splitlines()) < 30
