"""Rehearsal: fine-tune a clone on the target's demonstrations and on the source's."""

from __future__ import annotations

from typing import Any

from shapechanger.transfer.methods import Method, MethodRun


class Rehearsal(Method):
    """Fine-tune on batches that mix the target's demonstrations with the source's.

    A few seconds of a target show little of its world, and a clone that learns from them alone
    forgets the rest. The share of the source in each batch is `rehearsal` of the learner's
    `CloneSettings`.
    """

    name = "rehearsal"
    needs = (("demonstrations", "a learner that clones demonstrations"),)
    paper = "A. Robins, Catastrophic Forgetting, Rehearsal and Pseudorehearsal, Conn. Sci., 1995"

    def learn(self, run: MethodRun) -> Any:
        """Train on both, starting from the source policy."""
        rehearsed = (run.source, run.source_steps, run.shared("source"))
        return run.fine_tune(rehearsed=rehearsed)
