"""Driving policies that are learned from pictures and from what a driver did on seeing them.

`train.clone` learns one from arrays, `policy.CameraPolicy` keeps, saves and loads it, and `sb3`
hands it to a learner that goes on by reward. Nothing is imported here: settings are read where
there is no torch.
"""

from __future__ import annotations

from typing import Final

__all__: Final[list[str]] = []
