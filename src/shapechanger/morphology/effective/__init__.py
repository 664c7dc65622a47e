"""Effective models: what decides a compiled model's motion, and its fingerprint."""

from __future__ import annotations

from shapechanger.morphology.effective.model import EffectiveModel, effective_model, fingerprint

__all__ = ["EffectiveModel", "effective_model", "fingerprint"]
