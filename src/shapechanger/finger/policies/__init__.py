"""The policies of the finger that come with the package, with their card in `README.md`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

__all__ = ["POLICIES"]

_FOLDER: Final = Path(__file__).parent

POLICIES: Final[Mapping[str, Path]] = MappingProxyType(
    {task: _FOLDER / f"{task}.safetensors" for task in ("reach", "track")}
)
"""File of the policy of each task: "reach" for `Finger-v1`, "track" for `FingerTrack-v1`."""
