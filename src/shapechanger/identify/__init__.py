"""What a finger is like, found out from a log of how it moved."""

from __future__ import annotations

from shapechanger.identify.identified import Estimate, Identified
from shapechanger.identify.log import FingerLog
from shapechanger.identify.log_file import load_log, save_log
from shapechanger.identify.whole import identify

__all__ = ["Estimate", "FingerLog", "Identified", "identify", "load_log", "save_log"]
