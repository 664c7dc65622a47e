"""Work on an `MjSpec` that edits share: finding, naming, measuring, stretching, grafting."""

from __future__ import annotations

from shapechanger.morphology.spec.elements import name_elements

__all__ = ["name_elements"]
