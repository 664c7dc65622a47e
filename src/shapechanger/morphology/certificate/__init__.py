"""Certificate of a shift: the proven differences between two embodiments."""

from __future__ import annotations

from shapechanger.morphology.certificate.certify import (
    Certificate,
    Rollout,
    certify,
    inconsistencies,
)
from shapechanger.morphology.certificate.changes import Change, compare, fingerprint

__all__ = [
    "Certificate",
    "Change",
    "Rollout",
    "certify",
    "compare",
    "fingerprint",
    "inconsistencies",
]
