# /// script
# dependencies = ["shapechanger[sim,learn,report,cli]"]
# ///
"""A custom transfer method, compared with scratch and fine-tuning on two poles.

The method freezes everything but the last layer. With the installed command, from this folder:

    shapechanger transfer InvertedPendulum BigInvertedPendulum --arms scratch new_method:last-layer
"""

from pathlib import Path

import tyro
from stable_baselines3.common.callbacks import BaseCallback

from shapechanger import TransferTask, make_plan, run_study
from shapechanger.transfer import EnvRef
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.methods import Method, MethodRun, register
from shapechanger.transfer.report.verdict import verdict


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
        return run.fine_tune(callback=OnlyLastLayer())


def main(steps: int = 24_576, seeds: int = 3, out: Path = Path("results/last-layer")) -> None:
    """Run the study, with `steps` training steps in source and target."""
    task = TransferTask(
        EnvRef("shapechanger/InvertedPendulum-v1"), EnvRef("shapechanger/BigInvertedPendulum-v1")
    )
    plan = make_plan(
        task,
        "ppo-pendulum",
        learner_settings("ppo-pendulum"),
        steps=steps,
        source_steps=steps,
        seeds=seeds,
        arms=("scratch", "fine-tune", "new_method:last-layer"),
    )
    study = run_study(plan, out)
    print(verdict(study))


if __name__ == "__main__":  # The runs are separate processes, which import this file.
    tyro.cli(main)
