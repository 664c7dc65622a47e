"""One policy for bodies outside the training, against a padded network with the same data.

Each policy is trained in 32 drawn ants. It is evaluated in these ants, in 32 other ants of each
split, and in the extended ant, whose legs have more joints, with one episode in each body. Policies
are kept in `results/generalist`, and finished trainings are not repeated. `SEEDS` sets the number
of trainings, and `WORKERS` how many run at a time. The scores of each body are written to
`benchmarks/results/generalist-runs.json`.
"""

from __future__ import annotations

import json
import math
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy import stats

from benchmarks.row import Row
from shapechanger.contract.env_ref import BodyDraw, EnvRef, each_body
from shapechanger.files import read_json, write_json
from shapechanger.policy import load_policy, save_policy
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners import ignore
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.learners.settings import LimbSettings
from shapechanger.transfer.limbs.envs import LimbLearner, fitted

OUT: Final = Path("results", "generalist")
RUNS: Final = Path("benchmarks", "results", "generalist-runs.json")
GPU_POLICY: Final = RUNS.with_name("generalist-gpu.safetensors")
SPECIALISTS: Final = RUNS.with_name("atlas-ants-runs.json")
# Episodes in each ant that has specialists.
EPISODES: Final = 3
COMMAND: Final = "python -m benchmarks.run generalist"
SEEDS: Final = 5
BODIES: Final = 32
STEPS: Final = 1_048_576
# Steps that the policy learns in each body, and the budget of a policy of a single body.
SHARE: Final = STEPS // BODIES
SCRATCH_BODIES: Final = 8
ANT: Final = EnvRef("shapechanger/Ant-v1")
EXTENDED: Final = EnvRef("shapechanger/ExtendedAnt-v1")
SPLITS: Final = ("train", "interpolation", "extrapolation", "composition")
# A second draw of the split "extrapolation", because the first one was known during the design.
AGAIN: Final = "extrapolation, second draw"
_RESAMPLES: Final = 4000

Network = Literal["limbs", "padded"]
_Floats = NDArray[np.float64]


class Scores(msgspec.Struct, frozen=True):
    """Forward speed of one policy in each body, m/s.

    Attributes:
        network: Kind of the policy's network.
        seed: Seed of its training.
        splits: Speed in each body, keyed by split or `AGAIN`.
        extended: Speed in the extended ant.
        command: The command that measured the speeds.
    """

    network: str
    seed: int
    splits: dict[str, list[float]]
    extended: float
    command: str = COMMAND


def generalist() -> list[Row]:
    """Train and evaluate the policies of both networks."""
    seeds = range(int(os.environ.get("SEEDS", SEEDS)))
    work = [(network, seed) for seed in seeds for network in ("limbs", "padded")]
    OUT.mkdir(parents=True, exist_ok=True)
    workers = int(os.environ.get("WORKERS", os.cpu_count() or 1))
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        found = list(pool.map(_judged, *zip(*work, strict=True)))
        alone = list(pool.map(_scratch, SPLITS[1:]))
    write_json(RUNS, found)
    own = zip(SPLITS[1:], alone, strict=True)
    return [*rows_of(found), *(_scratch_row(found, *one) for one in own)]


def rows_of(found: list[Scores]) -> list[Row]:
    """Return both networks' speeds in each split and in the extended ant, and which is ahead."""
    rows: list[Row] = []
    by_network = {
        network: [one for one in found if one.network == network] for network in ("limbs", "padded")
    }
    for split in (*SPLITS, AGAIN):
        speeds = {
            network: np.array([one.splits[split] for one in each])
            for network, each in by_network.items()
        }
        ahead, low, high = _improvement(speeds["limbs"], speeds["padded"])
        asked = split in ("interpolation", "extrapolation")
        rows.append(
            Row(
                f"{BODIES} ants, {split}: probability that limbs are faster than padded",
                f"{ahead:.2f} [{low:.2f}, {high:.2f}]",
                f"limbs {_speed(speeds['limbs'])}, padded {_speed(speeds['padded'])}; "
                f"{len(by_network['limbs'])} seeds",
                "interval above 0.5" if asked else "none",
                low > 0.5 or not asked,
            )
        )
    longer = {n: np.array([[one.extended] for one in each]) for n, each in by_network.items()}
    rows.append(
        Row(
            "ExtendedAnt, which has 12 joints, zero-shot: forward speed",
            f"limbs {_speed(longer['limbs'])}",
            f"padded {_speed(longer['padded'])}; learned in ants of 8 and 9 joints",
            "walks, or the measured truth",
            True,
        )
    )
    return rows


def _speed(speeds: _Floats) -> str:
    """Return the mean over bodies, with an interval over seeds; speeds (seeds, bodies), m/s."""
    each = speeds.mean(axis=1)
    if len(each) < 2:
        return f"{each.mean():.2f} m/s"
    half = stats.t.ppf(0.975, len(each) - 1) * each.std(ddof=1) / math.sqrt(len(each))
    return f"{each.mean():.2f} m/s [{each.mean() - half:.2f}, {each.mean() + half:.2f}]"


def _improvement(one: _Floats, other: _Floats) -> tuple[float, float, float]:
    """Return the probability that a policy of `one` is faster than a policy of `other` in a body.

    Policies are evaluated in all bodies, so the bootstrap draws policies and bodies independently.

    Args:
        one: Speeds, shape (seeds, bodies).
        other: Speeds in the same bodies, shape (seeds, bodies).
    """
    wins = 0.5 + 0.5 * np.sign(one[:, None] - other[None])
    rng = np.random.default_rng(0)
    a, b, bodies = wins.shape
    drawn = [
        wins[
            np.ix_(
                rng.integers(a, size=a), rng.integers(b, size=b), rng.integers(bodies, size=bodies)
            )
        ].mean()
        for _ in range(_RESAMPLES)
    ]
    low, high = np.quantile(drawn, [0.025, 0.975])
    return float(wins.mean()), float(low), float(high)


def _judged(network: Network, seed: int) -> Scores:
    """Train a policy unless its file exists, and measure its speed in every body."""
    use_one_thread()
    file, result = (OUT / f"{network}-{seed}.{kind}" for kind in ("safetensors", "json"))
    if result.exists():
        return read_json(result, Scores, f"delete {result}")
    if not file.exists():
        learner = LimbLearner(network, _settings(network))
        draw = BodyDraw(count=BODIES)
        policy = learner.train(
            ANT.having({"bodies": msgspec.to_builtins(draw)}), STEPS, seed, on_evaluation=ignore
        )
        save_policy(policy.carded(command=COMMAND), file)
    scores = _scores(network, seed, file)
    write_json(result, scores)
    return scores


def _scores(network: str, seed: int, file: Path) -> Scores:
    """Measure the speed of a policy in every body."""
    splits = {split: [_speed_in(file, body) for body in _bodies(split)] for split in SPLITS}
    splits[AGAIN] = [_speed_in(file, body) for body in _bodies("extrapolation", draw=1)]
    return Scores(network, seed, splits, _speed_in(file, EXTENDED))


def of_gpu() -> list[Row]:
    """Evaluate the policy that `gpu-generalist` trained in many ants."""
    card = load_policy(GPU_POLICY).card
    scores = _scores("limbs", card.seed, GPU_POLICY)
    learned = f"one policy, {card.steps:,} steps in {card.env.kwargs['bodies']['count']} ants"
    return [
        *(
            Row(
                f"{len(speeds)} ants, {split}: forward speed, learned on a GPU",
                f"{np.mean(speeds):.2f} m/s",
                f"{min(speeds):.2f} to {max(speeds):.2f} m/s in a body; {learned}",
                "none: whatever comes out",
                True,
            )
            for split, speeds in scores.splits.items()
        ),
        Row(
            "ExtendedAnt, zero-shot: forward speed, learned on a GPU",
            f"{scores.extended:.2f} m/s",
            learned,
            "none: whatever comes out",
            True,
        ),
    ]


def against_specialists() -> list[Row]:
    """Compare the policy that `gpu-generalist` trained with policies trained in one ant each.

    The specialists are the sources of the suite of ants. Their speed is the mean of the last three
    evaluations, as in the atlas.
    """
    use_one_thread()
    atlas = json.loads(SPECIALISTS.read_text())
    rows: list[Row] = []
    for name in ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt"):
        sources = next(
            runs["source"] for pair, runs in atlas.items() if pair.startswith(f"{name}-")
        )
        alone = float(np.mean([run["values"][-3:] for run in sources]))
        ours = _speed_in(GPU_POLICY, EnvRef(f"shapechanger/{name}-v1"), EPISODES)
        rows.append(
            Row(
                f"{name}: forward speed of a policy learned on a GPU over that of specialists",
                f"{ours / alone:.0%}",
                f"{ours:.2f} m/s zero-shot, {EPISODES} episodes; {len(sources)} specialists "
                f"{alone:.2f} m/s after {sources[0]['steps'][-1]:,} steps in {name}",
                "none: whatever comes out",
                True,
            )
        )
    return rows


def _settings(network: str) -> LimbSettings:
    return cast("LimbSettings", learner_settings(network))


def _bodies(split: str, draw: int = 0) -> list[EnvRef]:
    return each_body(ANT.having({"bodies": {"split": split, "count": BODIES, "seed": draw}}))


def _speed_in(file: Path, body: EnvRef, episodes: int = 1) -> float:
    """Return the forward speed of a policy in a body over some episodes, m/s."""
    policy = load_policy(file)
    room = getattr(policy.card.settings, "room", 0)
    env = fitted(body.make(), policy.card.observation, room)
    try:
        return evaluate(policy.act, [env], EVALUATION_SEED, episodes=episodes).value(
            "forward speed"
        )
    finally:
        env.close()


def _scratch(split: str) -> list[float]:
    """Return the speeds of policies of limbs, each of which learned in one body only, m/s."""
    use_one_thread()
    result = OUT / f"scratch-{split}.json"
    if result.exists():
        return read_json(result, list[float], f"delete {result}")
    speeds: list[float] = []
    for seed, body in enumerate(_bodies(split)[:SCRATCH_BODIES]):
        found: list[float] = []
        settings = msgspec.structs.replace(_settings("limbs"), eval_every=SHARE, eval_episodes=1)
        learner = LimbLearner("limbs", settings)
        learner.train(
            body,
            SHARE,
            seed,
            on_evaluation=lambda one, found=found: found.append(one.value("forward speed")),
        )
        speeds.append(found[-1])
    write_json(result, speeds)
    return speeds


def _scratch_row(found: list[Scores], split: str, alone: list[float]) -> Row:
    """Compare zero-shot with policies that learned in the body itself, for `SHARE` steps."""
    limbs = np.array(
        [one.splits[split][:SCRATCH_BODIES] for one in found if one.network == "limbs"]
    )
    return Row(
        f"{SCRATCH_BODIES} ants, {split}: zero-shot over scratch in the body itself",
        f"{limbs.mean():.2f} and {np.mean(alone):.2f} m/s",
        f"scratch learns for {SHARE:,} steps, what each training body has had",
        "zero-shot is faster",
        bool(limbs.mean() > np.mean(alone)),
    )
