"""Embodiment times task, as Gymnasium envs; importing this loads no simulator."""

from __future__ import annotations

from shapechanger.envs.catalogue import CATALOGUE, Entry, find, register_all

__all__ = ["CATALOGUE", "Entry", "find", "register_all"]
