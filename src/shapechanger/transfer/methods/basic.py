"""Scratch, zero-shot and fine-tune: the arms that every pair of bodies can be compared by."""

from __future__ import annotations

from typing import Any

from shapechanger.transfer.methods import Method, MethodRun


class Scratch(Method):
    """Learn the target from the start, without the source: the baseline."""

    name = "scratch"
    uses_source_policy = False
    uses_source = False

    def learn(self, run: MethodRun) -> Any:
        """Train on the target."""
        return run.train(run.target, run.steps, on_evaluation=run.report)


class ZeroShot(Method):
    """Act on the target with the source policy, through the body map, without learning."""

    name = "zero-shot"
    trains = False
    learns_on_target = False

    def learn(self, run: MethodRun) -> Any:
        """Evaluate the source policy on the target."""
        run.report(run.evaluate(run.source_policy()))


class FineTune(Method):
    """Learn the target from the source policy, whose weights are transplanted by the body map."""

    name = "fine-tune"
    paper = "M. E. Taylor and P. Stone, Transfer Learning for Reinforcement Learning Domains, 2009"

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune()
