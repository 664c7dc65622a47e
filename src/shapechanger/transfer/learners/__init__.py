"""Learners: training, evaluating and storing policies."""

from __future__ import annotations

__all__: list[str] = []
