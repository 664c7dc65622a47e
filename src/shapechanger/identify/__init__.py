"""What a finger is like, found out from a log of how it moved."""

from __future__ import annotations

from shapechanger.identify.log import FingerLog, load_log, save_log
from shapechanger.identify.result import IdentifiedFinger, ParameterEstimate, identify

__all__ = ["FingerLog", "IdentifiedFinger", "ParameterEstimate", "identify", "load_log", "save_log"]
