"""Success of learned reaching and following: five seeds each, with learning curves.

Policies and curves are kept in `results/finger`; finished trainings are not repeated. The curves
are published with the rows, in `finger-curves.json`.
"""

from __future__ import annotations

import json
import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import gymnasium as gym
import msgspec
import numpy as np

from benchmarks.finger_oracle import FIRST_SEED, tracked_mm
from benchmarks.row import Row
from shapechanger.contract.env_ref import EnvRef
from shapechanger.files import write_atomic
from shapechanger.finger.gap import GAPS
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import PpoSettings

SEEDS: Final = 5
TARGETS: Final = 200
TRACKS: Final = 5
FOLDER: Final = Path("results", "finger")
CURVES: Final = Path(__file__).parent / "results" / "finger-curves.json"
CIRCLE: Final = {"kind": "circle", "radius": 0.012, "hz": 0.5}


@dataclass(frozen=True)
class Task:
    """Task to learn.

    Attributes:
        env: The env.
        learner: Name of the learner's settings.
        steps: Env steps.
    """

    env: EnvRef
    learner: str
    steps: int


TASKS: Final = {
    "reach": Task(EnvRef("shapechanger/Finger-v1"), "ppo-finger", 307_200),
    # Trained on random paths, so that the policy generalises to others.
    "track": Task(EnvRef("shapechanger/FingerTrack-v1", {"path": "random"}), "ppo-finger", 307_200),
    # Trained in the gap of a rig, but with the nominal finger's moment arms and joints.
    "rig": Task(
        EnvRef(
            "shapechanger/Finger-v1",
            {
                "gap": msgspec.to_builtins(
                    msgspec.structs.replace(
                        GAPS["real-like"], arm_error=0.0, joint_factor=(1.0, 1.0)
                    )
                ),
                "reward": {"change": 5.0},
            },
        ),
        "ppo-finger",
        307_200,
    ),
}


def learned() -> list[Row]:
    """Train the missing policies, and evaluate them on unseen targets and on a circle."""
    seeds = range(int(os.environ.get("SEEDS", SEEDS)))
    wanted = [(name, seed) for name in ("reach", "track") for seed in seeds]
    FOLDER.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        list(pool.map(trained, *zip(*wanted, strict=True)))
    curves = {f"{name}-{seed}": json.loads(_curve(name, seed).read_text()) for name, seed in wanted}
    write_atomic(CURVES, (json.dumps(curves, indent=1) + "\n").encode())
    reach, track = ([_file(name, seed) for seed in seeds] for name in ("reach", "track"))
    return [
        _reach_row(f"learned reaching, {len(seeds)} seeds", reach),
        _track_row(f"learned following, {len(seeds)} seeds", track),
    ]


def shipped() -> list[Row]:
    """Evaluate the shipped policies on unseen targets."""
    return [
        _reach_row("shipped policy that reaches", [POLICIES["reach"]]),
        _track_row("shipped policy that follows", [POLICIES["track"]]),
    ]


def trained(name: str, seed: int) -> Path:
    """Return the file of a policy; train it if it does not exist."""
    out = _file(name, seed)
    if out.exists():
        return out
    FOLDER.mkdir(parents=True, exist_ok=True)
    task = TASKS[name]
    settings = learner_settings(task.learner)
    assert isinstance(settings, PpoSettings)
    use_one_thread()
    curve: list[Evaluation] = []
    policy = Sb3Learner(task.learner, settings).train(
        task.env, task.steps, seed, on_evaluation=curve.append
    )
    write_atomic(_curve(name, seed), msgspec.json.encode(curve))
    save_policy(policy, out)
    return out


def _file(name: str, seed: int) -> Path:
    return FOLDER / f"{name}-{seed}.safetensors"


def _curve(name: str, seed: int) -> Path:
    return FOLDER / f"{name}-{seed}.json"


def _reach_row(label: str, policies: list[Path]) -> Row:
    shares: list[float] = []
    errors: list[float] = []
    for policy in policies:
        infos = played(load_policy(policy), TASKS["reach"].env, TARGETS)
        shares.append(float(np.mean([info["is_success"] for info in infos])))
        errors.append(1e3 * float(np.median([info["distance"] for info in infos])))
    return Row(
        f"{label}: targets reached within 5 mm",
        f"{np.mean(shares):.1%}",
        f"{min(shares):.1%} to {max(shares):.1%} of {TARGETS}, median errors "
        f"{min(errors):.2f} to {max(errors):.2f} mm, {TASKS['reach'].steps:,} steps",
        "90 %",
        min(shares) >= 0.9,
    )


def _track_row(label: str, policies: list[Path]) -> Row:
    env = EnvRef("shapechanger/FingerTrack-v1", {"path": CIRCLE})
    errors = [
        1e3 * float(np.mean([info["rms"] for info in played(load_policy(policy), env, TRACKS)]))
        for policy in policies
    ]
    knows = float(np.mean([tracked_mm(0.5, FIRST_SEED + i) for i in range(TRACKS)]))
    ratios = [error / knows for error in errors]
    return Row(
        f"{label}: circle of 12 mm at 0.5 Hz",
        f"{np.mean(errors):.2f} mm RMS, {np.mean(ratios):.2f}x",
        f"{min(ratios):.2f}x to {max(ratios):.2f}x of {knows:.2f} mm, "
        f"{TASKS['track'].steps:,} steps on other paths",
        "2x of the controller that knows the finger",
        max(ratios) <= 2.0,
    )


def played(
    policy: TrainedPolicy, env: EnvRef, episodes: int, first_seed: int = FIRST_SEED
) -> list[dict[str, Any]]:
    """Return the last info of each episode.

    Args:
        policy: The policy.
        env: The env.
        episodes: Number of episodes.
        first_seed: Seed of the first episode.
    """
    infos: list[dict[str, Any]] = []
    with gym.make(env.id, **env.kwargs) as made:
        for i in range(episodes):
            observation, info = made.reset(seed=first_seed + i)
            ended = False
            while not ended:
                action = policy.act(observation[None])[0]
                observation, _, terminated, truncated, info = made.step(action)
                ended = terminated or truncated
            infos.append(info)
    return infos
