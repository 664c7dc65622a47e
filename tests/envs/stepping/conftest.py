"""The tests look for a twin at once."""

from __future__ import annotations

import pytest

from shapechanger.envs.stepping.tuned import TunedStep


@pytest.fixture(autouse=True)
def no_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the first step of a body look for its twin."""
    monkeypatch.setattr(TunedStep, "patience", 0)
