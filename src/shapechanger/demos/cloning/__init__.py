"""Driving policies that are learned from pictures and from what a driver did on seeing them.

`clone` learns one from arrays, `CameraPolicy` keeps, saves and loads it, and
`shapechanger.demos.cloning.sb3` hands it to a learner that goes on by reward.
"""

from __future__ import annotations

from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.policy import CameraPolicy, Card
from shapechanger.demos.cloning.settings import Augmentation, CloneSettings
from shapechanger.demos.cloning.train import History, clone

__all__ = [
    "Augmentation",
    "CameraPolicy",
    "Card",
    "CloneSettings",
    "Framing",
    "History",
    "clone",
    "prepare",
]
