"""The robots: where each model comes from, its constants with their sources, its named bodies."""

from __future__ import annotations

from shapechanger.bodies.families import Family

__all__ = ["Family"]
