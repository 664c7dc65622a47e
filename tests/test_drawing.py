"""What a test does that cannot draw."""

from __future__ import annotations

import pytest

from tests.drawing import missing


def test_a_test_that_cannot_draw_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """A developer without OpenGL still runs the rest."""
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match="no crayons"):
        missing("There are no crayons")


def test_on_ci_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures that nobody checks any more would go unnoticed there."""
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match="no crayons, and on CI nothing"):
        missing("There are no crayons")
