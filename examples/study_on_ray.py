"""A transfer study on a Ray cluster: from the pole of the paper to one twice as long.

Without RAY_ADDRESS, Ray starts on this machine for the time of the study. On a cluster, OUT is a
folder that all nodes share.
"""

import os
from pathlib import Path

from shapechanger import TransferTask, make_plan, run_study
from shapechanger.cli.transfer import write_study_report
from shapechanger.reports.verdict import verdict
from shapechanger.transfer import EnvRef
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.ray_executor import RayCluster

STEPS = int(os.environ.get("STEPS", "24576"))
OUT = Path(os.environ.get("OUT", "results/on-ray"))

if __name__ == "__main__":  # The workers import this file.
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
        arms=("scratch", "zero-shot", "fine-tune"),
    )
    study = run_study(
        plan,
        OUT,
        executor=RayCluster(os.environ.get("RAY_ADDRESS")),
        on_progress=lambda run, steps, ended: print(f"{run} has ended") if ended else None,
    )
    print(verdict(study))
    print(f"The report: {write_study_report(study, OUT)}")
