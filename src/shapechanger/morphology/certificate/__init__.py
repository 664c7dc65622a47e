"""The certificate of a shift: what differs between two embodiments, proven, or a refusal."""

from __future__ import annotations

from shapechanger.morphology.certificate.certify import Certificate, certify
from shapechanger.morphology.certificate.changes import Change, compare, fingerprint
from shapechanger.morphology.certificate.consistency import inconsistencies
from shapechanger.morphology.certificate.rollout import Certifiable, Rollout, Wrapped

__all__ = [
    "Certifiable",
    "Certificate",
    "Change",
    "Rollout",
    "Wrapped",
    "certify",
    "compare",
    "fingerprint",
    "inconsistencies",
]
