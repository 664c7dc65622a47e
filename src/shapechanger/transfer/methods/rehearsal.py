"""Rehearsal: fine-tune a clone on the target's demonstrations and on the source's."""

from __future__ import annotations

from typing import Any, cast

from shapechanger.contract.env_ref import EnvTraits
from shapechanger.transfer.learners.cloning import load_or_record
from shapechanger.transfer.learners.settings import CloningSettings, Settings
from shapechanger.transfer.methods import Method, MethodRun


class Rehearsal(Method):
    """Fine-tune on batches that mix the target's demonstrations with the source's.

    A few seconds of a target show little of its world, and a clone that learns from them alone
    forgets the rest. The share of the source in each batch is `rehearsal` of the learner's
    `CloneSettings`.
    """

    name = "rehearsal"
    paper = "A. Robins, Catastrophic Forgetting, Rehearsal and Pseudorehearsal, Conn. Sci., 1995"

    def require(self, source: EnvTraits, target: EnvTraits, settings: Settings) -> None:
        """Refuse learners that do not clone demonstrations."""
        del source, target
        if not isinstance(settings, CloningSettings):
            raise self._lacks("a learner that clones demonstrations")

    def learn(self, run: MethodRun) -> Any:
        """Train on both, starting from the source policy."""
        settings = cast("CloningSettings", run.settings)
        seen = load_or_record(
            run.source_demonstrations(),
            run.source,
            run.source_steps,
            settings.episode_steps,
            settings.clone.framing,
        )
        return run.train(
            run.target,
            run.steps,
            start=run.source_policy(),
            body_map=run.body_map,
            rehearsal=seen,
            on_evaluation=run.report,
        )
