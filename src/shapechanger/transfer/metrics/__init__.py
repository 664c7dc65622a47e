"""Measures of transfer: pure functions on learning curves.

`curves.LearningCurves` has the curves of one arm, and `curves.Reference` converts returns to
scores. `measures` compares an arm with scratch by the measures of Taylor & Stone and by forward
transfer; its `summarise` computes all of them, in target steps and in total steps. `intervals`
computes confidence intervals.

One sample of all statistics is a seed, that is, a training run. Episodes of one run share a policy,
so intervals would be too narrow if episodes counted as independent.
"""
