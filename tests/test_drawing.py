"""Skipping of tests that cannot draw."""

from __future__ import annotations

import pytest

from tests.drawing import missing


def test_a_test_that_cannot_draw_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    """`missing` skips the test on a developer's machine."""
    monkeypatch.delenv("CI", raising=False)
    with pytest.raises(pytest.skip.Exception, match="no crayons"):
        missing("There are no crayons")


def test_a_test_that_cannot_draw_fails_on_ci(monkeypatch: pytest.MonkeyPatch) -> None:
    """`missing` fails the test on CI, so that rendering is not silently untested."""
    monkeypatch.setenv("CI", "true")
    with pytest.raises(pytest.fail.Exception, match="no crayons, and on CI nothing"):
        missing("There are no crayons")
