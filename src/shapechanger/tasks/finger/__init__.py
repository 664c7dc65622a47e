"""What a finger is asked to do, whether it is simulated or stands on a bench."""

from __future__ import annotations

from shapechanger.tasks.finger.kinematics import fingertip, fingertip_jacobian
from shapechanger.tasks.finger.reward import FingertipReward
from shapechanger.tasks.finger.senses import FingerSenses, features_of_senses, place_features

__all__ = [
    "FingerSenses",
    "FingertipReward",
    "features_of_senses",
    "fingertip",
    "fingertip_jacobian",
    "place_features",
]
