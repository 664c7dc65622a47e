"""Expert driving with full knowledge of the course: planned paths and a driver."""

from __future__ import annotations

from typing import Final

PERIOD_S: Final = 0.05
"""Control period of the experts, s."""
