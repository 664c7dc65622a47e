"""The certificate of a shift: what differs between two embodiments, proven, or a refusal."""

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
