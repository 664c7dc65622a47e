"""Bodies: families of named bodies, the finger and the vehicles."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]
except ImportError as error:
    raise MissingExtra("mujoco", "sim") from error

from shapechanger.bodies.families import Family

__all__ = ["Family"]
