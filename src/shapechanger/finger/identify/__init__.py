"""Identification of a finger's parameters from a log of its motion."""

from __future__ import annotations

from shapechanger.finger.identify.log import FingerLog, load_log, record_babble, save_log
from shapechanger.finger.identify.result import IdentifiedFinger, ParameterEstimate, identify

__all__ = [
    "FingerLog",
    "IdentifiedFinger",
    "ParameterEstimate",
    "identify",
    "load_log",
    "record_babble",
    "save_log",
]
