# /// script
# dependencies = ["shapechanger[sim,learn,report,cli,ray]"]
# ///
"""A transfer study on a Ray cluster: from a pole to one twice as long.

Without an address, Ray starts on this machine for the time of the study. On a cluster, all nodes
must share the folder of the study.
"""

from pathlib import Path

import tyro

from shapechanger import TransferTask, make_plan, run_study
from shapechanger.transfer import EnvRef
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.ray_executor import RayCluster
from shapechanger.transfer.report.study import write_study_report
from shapechanger.transfer.report.verdict import verdict


def main(
    steps: int = 24_576,
    seeds: int = 3,
    out: Path = Path("results/on-ray"),
    address: str | None = None,
) -> None:
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
        arms=("scratch", "zero-shot", "fine-tune"),
    )
    study = run_study(
        plan,
        out,
        executor=RayCluster(address),
        on_progress=lambda run, steps, ended: print(f"{run} has ended") if ended else None,
    )
    print(verdict(study))
    print(f"The report: {write_study_report(study, out)}")


if __name__ == "__main__":  # The workers import this file.
    tyro.cli(main)
