"""A transfer method of one's own, compared with scratch and fine-tuning on two poles.

It freezes everything but the last layer. With the installed command, from this folder:

    shapechanger transfer InvertedPendulum BigInvertedPendulum --arms scratch new_method:last-layer
"""

import os
from pathlib import Path

from stable_baselines3.common.callbacks import BaseCallback

from shapechanger import TransferTask, make_plan, run_study
from shapechanger.reports.verdict import verdict
from shapechanger.transfer import EnvRef
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.methods import Method, MethodRun, register

STEPS = int(os.environ.get("STEPS", "24576"))
OUT = Path(os.environ.get("OUT", "results/last-layer"))


class OnlyLastLayer(BaseCallback):
    """Train the last layer of the actor and of the critic alone."""

    def _on_training_start(self) -> None:
        policy = self.model.policy
        for parameter in policy.mlp_extractor.parameters():
            parameter.requires_grad_(False)

    def _on_step(self) -> bool:
        return True


@register
class LastLayer(Method):
    """Fine-tune the last layer of the source's policy."""

    name = "last-layer"

    def learn(self, run: MethodRun):
        """Train on the target, from the source's weights."""
        return run.train(
            run.target,
            run.steps,
            start=run.source_policy(),
            body_map=run.body_map,
            callback=OnlyLastLayer(),
            on_evaluation=run.report,
        )


if __name__ == "__main__":  # The runs are separate processes, which import this file.
    task = TransferTask(
        EnvRef("shapechanger/InvertedPendulum-v1"), EnvRef("shapechanger/BigInvertedPendulum-v1")
    )
    plan = make_plan(
        task,
        "ppo-balance",
        learner_settings("ppo-balance"),
        steps=STEPS,
        source_steps=STEPS,
        seeds=3,
        arms=("scratch", "fine-tune", "new_method:last-layer"),
    )
    study = run_study(plan, OUT)
    print(verdict(study))
