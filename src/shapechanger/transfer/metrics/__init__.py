"""Measures of transfer: pure functions on learning curves.

`LearningCurves` holds the curves of one arm, `Reference` turns returns into scores, the functions
named after Taylor & Stone's measures and `forward_transfer` compare an arm with scratch, and
`summarise` computes all of them, in target steps and in total steps.

The unit of all statistics is the seed, that is one training run. Episodes of one run share a
policy, and counting them as independent would make every interval too narrow.
"""

from shapechanger.transfer.metrics.curves import LearningCurves, Reference, in_total_steps
from shapechanger.transfer.metrics.intervals import (
    Estimate,
    estimate_difference,
    estimate_ratio,
    interquartile_mean,
    probability_of_improvement,
    undefined,
)
from shapechanger.transfer.metrics.measures import (
    DEFAULT_THRESHOLDS,
    MIN_HEADROOM,
    Measures,
    ReachTimes,
    Summary,
    TimeToThreshold,
    asymptotic_gain,
    auc_ratio,
    forward_transfer,
    jumpstart,
    steps_to_reach,
    summarise,
    time_to_threshold,
    total_reward_gain,
)

__all__ = [
    "DEFAULT_THRESHOLDS",
    "MIN_HEADROOM",
    "Estimate",
    "LearningCurves",
    "Measures",
    "ReachTimes",
    "Reference",
    "Summary",
    "TimeToThreshold",
    "asymptotic_gain",
    "auc_ratio",
    "estimate_difference",
    "estimate_ratio",
    "forward_transfer",
    "in_total_steps",
    "interquartile_mean",
    "jumpstart",
    "probability_of_improvement",
    "steps_to_reach",
    "summarise",
    "time_to_threshold",
    "total_reward_gain",
    "undefined",
]
