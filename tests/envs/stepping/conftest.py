"""Make the fast model available from the first step on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import chdir

import pytest

from shapechanger.envs.stepping.tuned import TunedStep


@pytest.fixture(autouse=True)
def no_patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Search for the fast model at the first step of a body."""
    monkeypatch.setattr(TunedStep, "patience", 0)


@pytest.fixture(scope="module")
def log_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Change to a temporary folder, since MuJoCo writes a log file."""
    with chdir(tmp_path_factory.mktemp("log")):
        yield
