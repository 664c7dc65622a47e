"""What a compiled model effectively does, whichever way it was written, and its fingerprint."""

from __future__ import annotations

from shapechanger.morphology.effective.contacts import effective_contacts
from shapechanger.morphology.effective.model import EffectiveModel, effective_model, fingerprint

__all__ = ["EffectiveModel", "effective_contacts", "effective_model", "fingerprint"]
