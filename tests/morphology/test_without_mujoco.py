"""Morphology without MuJoCo installed."""

from __future__ import annotations

import importlib
import sys

import pytest

import shapechanger.morphology
from shapechanger.errors import MissingExtra


def test_the_extra_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtra, match=r"pip install 'shapechanger\[sim\]'"):
        importlib.reload(shapechanger.morphology)
