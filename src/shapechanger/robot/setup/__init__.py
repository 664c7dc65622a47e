"""Setup of a robot: checks, calibration, zeros of joints and tendons, and the systemd unit."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
