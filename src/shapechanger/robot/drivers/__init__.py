"""What speaks to the pins and buses: outputs and sensors."""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
