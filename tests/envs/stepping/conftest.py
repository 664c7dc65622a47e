"""Make the fast model available from the first step on."""

from __future__ import annotations

import pytest

from shapechanger.envs.stepping.tuned import TunedStep


@pytest.fixture(autouse=True)
def no_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search for the fast model at the first step of a body."""
    monkeypatch.setattr(TunedStep, "patience", 0)
