"""Gymnasium envs that join bodies and tasks; importing this package loads no simulator."""

from __future__ import annotations

from shapechanger.envs.catalogue import CATALOGUE, CatalogueEntry, find, register_all

__all__ = ["CATALOGUE", "CatalogueEntry", "find", "register_all"]
