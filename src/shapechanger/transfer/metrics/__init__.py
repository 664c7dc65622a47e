"""Measures of transfer: pure functions on learning curves.

`curves.LearningCurves` holds the curves of one arm, and `curves.Reference` turns returns into
scores. `measures` compares an arm with scratch by the measures of Taylor & Stone and by forward
transfer; its `summarise` computes all of them, in target steps and in total steps. `intervals` has
their confidence intervals.

The unit of all statistics is the seed, that is one training run. Episodes of one run share a
policy, and counting them as independent would make every interval too narrow.
"""
