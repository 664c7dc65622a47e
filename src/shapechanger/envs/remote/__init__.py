"""Gymnasium envs of vehicles and fingers that are reached over the link."""

from __future__ import annotations

__all__: list[str] = []
