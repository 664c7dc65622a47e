"""Transfer of a policy of the nominal finger to other fingers and to rigs.

The study equals `shapechanger transfer Finger Finger --target-options '{"gap": "real-like"}'
--source-policy ...` with the shipped policy; each seed has another finger. It is kept in
`results/finger-gap`, and finished runs are not repeated. The studies with `RemoteFinger-v1` and
`RemoteFingerTrack-v1`, on twins of a rig that the env serves itself, are kept in
`results/finger-rig` and `results/finger-follow`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.finger_learned import CIRCLE, TRACKS, played, trained
from benchmarks.finger_reach import Statics, held_by_controller
from benchmarks.row import Row
from shapechanger.cli.transfer import write_study_report
from shapechanger.envs.finger.policies import POLICIES
from shapechanger.reports.numbers import share_text
from shapechanger.reports.verdict import successes
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.executor import Processes
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED
from shapechanger.transfer.learners.policy_file import TrainedPolicy, load_policy
from shapechanger.transfer.learners.settings import learner_settings
from shapechanger.transfer.plan import ARMS, TransferTask
from shapechanger.transfer.study import Study, make_plan, run_study

SEEDS: Final = 10
# Twenty minutes on a bench; arms are also evaluated after ten.
STEPS: Final = 61_440
RIGS: Final = 5
TARGETS: Final = 20
RIG_STEPS: Final = 6144
_FINGER: Final = EnvRef("shapechanger/Finger-v1")
# Zero-shot success below this counts as a gap.
_MILD: Final = 0.5
_RECOVERED: Final = 0.8
_FOLLOWED: Final = 2.0
# Distance within which a target counts as reached, m, as in `Finger-v1`.
_NEAR_M: Final = 0.005
_LATE: Final = {"parameters": {"command_delay": 0.010}}


def gap() -> list[Row]:
    """Measure the success of each arm on fingers of the gap "real-like", and what makes the gap.

    The shipped policy in the nominal finger with a delay shows what a delay alone costs, and a
    policy of the nominal finger on the rig's motors what the other moment arms and joints cost.
    """
    target = _FINGER.having({"gap": "real-like"})
    study = _study(
        target,
        "ppo-finger",
        (*ARMS, "randomised", "identified"),
        SEEDS,
        STEPS,
        Path("results", "finger-gap"),
    )
    shipped, late = load_policy(POLICIES["reach"]), _FINGER.having(_LATE)
    delay_only = [info["is_success"] for info in played(shipped, late, TARGETS)]
    knows_rig = load_policy(trained("rig", 0))
    shares = np.array(
        [
            np.mean([i["is_success"] for i in played(knows_rig, target.having(one), TARGETS)])
            for one in ({"finger_seed": seed} for seed in range(study.plan.seeds))
        ],
        np.float64,
    )
    halves = [_halfway(study, arm) for arm in ("scratch", "fine-tune")]
    return [
        *rows_of(study, "fingers of the gap real-like"),
        *halves,
        *_ceiling(study, Path("results", "finger-gap")),
        Row(
            "nominal finger with a delay of 10 ms: targets reached by the shipped policy",
            f"{np.mean(delay_only):.0%}",
            f"{TARGETS} targets",
            "none",
            True,
        ),
        _share_row(
            "fingers of the gap real-like, policy that knows the rig's motors and delay only",
            shares,
        ),
    ]


def _ceiling(study: Study, out: Path) -> list[Row]:
    """Return how many targets of the study each finger can hold, and which ones policies miss."""
    plan = study.plan
    held, moved_to, controlled, reached = (np.zeros((plan.seeds, TARGETS), bool) for _ in range(4))
    for seed in range(plan.seeds):
        finger = plan.task.target.having({"finger_seed": seed})
        policy = load_policy(out / "runs" / f"identified-{seed}" / "policy.safetensors")
        ends = played(policy, finger, TARGETS, EVALUATION_SEED)
        reached[seed] = [info["is_success"] for info in ends]
        controlled[seed] = held_by_controller(finger.kwargs, EVALUATION_SEED, TARGETS)
        with finger.make() as env:
            inner: Any = env.unwrapped
            statics = Statics(inner.parameters)
        for i, info in enumerate(ends):
            held[seed, i] = statics.distance(info["target"]) <= _NEAR_M
            moved_to[seed, i] = statics.distance_coming_from_rest(info["target"]) <= _NEAR_M
    where = "fingers of the gap real-like"
    rows = {
        f"{where}: targets that some tensions hold within 5 mm": held,
        f"{where}: targets that the finger comes to from rest, against friction": moved_to,
        f"{where}, controller that knows the finger: targets reached within 5 mm": controlled,
    }
    others = reached[~moved_to]
    return [
        *(_share_row(name, shares.mean(axis=1)) for name, shares in rows.items()),
        Row(
            f"{where}, identified: reached of the targets that the finger comes to from rest",
            f"{reached[moved_to].mean():.0%}",
            f"{reached[moved_to].sum()} of {moved_to.sum()}; {others.sum()} of the other "
            f"{others.size}",
            "none",
            True,
        ),
    ]


def _share_row(name: str, shares: NDArray[np.float64]) -> Row:
    each = ", ".join(f"{share:.0%}" for share in shares)
    spread = f"{share_text(shares)} over {len(shares)} fingers: {each}"
    return Row(name, f"{shares.mean():.0%}", spread, "none", True)


def _halfway(study: Study, arm: str) -> Row:
    """Return the success of an arm after half of its steps."""
    steps = STEPS // 2
    shares = np.array(
        [
            float(np.mean([e.success or 0.0 for e in result.curve if e.steps == steps]))
            for result in study.of(arm)
        ]
    )
    return Row(
        f"fingers of the gap real-like, {arm} after {steps:,} steps",
        f"{shares.mean():.0%}",
        f"{share_text(shares)} over {len(shares)} fingers",
        "none",
        True,
    )


def rig() -> list[Row]:
    """Measure the same through link, daemon, guard and servo bus, with two minutes per rig."""
    target = EnvRef("shapechanger/RemoteFinger-v1", {"twin": "real-like"})
    arms: tuple[str, ...] = ("scratch", "zero-shot", "identified")
    study = _study(target, "ppo-rig", arms, RIGS, RIG_STEPS, Path("results", "finger-rig"))
    return rows_of(study, "twins of a rig, real-like")


def follow() -> list[Row]:
    """Measure how closely a circle is followed on twins of a rig, by policies that never saw one.

    Each policy learns other paths in the finger that was identified on its rig. The same policy on
    the circle in that simulated finger is the reference: a finger drawn from the gap in process has
    other motors and delays than the rig's servos.
    """
    source = EnvRef("shapechanger/FingerTrack-v1", {"path": "random"})
    circle = {"path": CIRCLE}
    target = EnvRef("shapechanger/RemoteFingerTrack-v1", {"twin": "real-like", **circle})
    out = Path("results", "finger-follow")
    arms = ("scratch", "zero-shot", "identified")
    study = _study(target, "ppo-rig", arms, RIGS, RIG_STEPS, out, source=source, policy="track")
    errors: list[tuple[float, float]] = []
    shipped: list[float] = []
    for seed in range(study.plan.seeds):
        run = out / "runs" / f"identified-{seed}"
        identified = load_policy(run / "policy.safetensors")
        rig = target.having({"finger_seed": seed})
        finger = msgspec.json.decode((run / "source.json").read_bytes(), type=EnvRef)
        errors.append((_rms_mm(identified, rig), _rms_mm(identified, finger.having(circle))))
        shipped.append(_rms_mm(load_policy(POLICIES["track"]), rig))
    there, here = np.array(errors).T
    known = f"circle of 12 mm at 0.5 Hz, {len(there)} fingers of the gap real-like"
    return [
        Row(
            f"{known}: error of the identified policy on a rig's twin over that in process",
            f"{np.mean(there / here):.2f}x",
            f"{', '.join(f'{each:.2f}x' for each in there / here)}; {np.mean(there):.2f} mm "
            f"({', '.join(f'{each:.2f}' for each in there)}) and {np.mean(here):.2f} mm RMS",
            "<= 2x",
            bool((there / here).max() <= _FOLLOWED),
        ),
        Row(
            f"{known}: error of the shipped policy on a rig's twin, zero-shot",
            f"{np.mean(shipped):.2f} mm RMS",
            ", ".join(f"{each:.2f}" for each in shipped),
            "none",
            True,
        ),
    ]


def _rms_mm(policy: TrainedPolicy, env: EnvRef) -> float:
    return 1e3 * float(np.mean([info["rms"] for info in played(policy, env, TRACKS)]))


def _study(
    target: EnvRef,
    learner: str,
    arms: tuple[str, ...],
    seeds: int,
    steps: int,
    out: Path,
    *,
    source: EnvRef = _FINGER,
    policy: Literal["reach", "track"] = "reach",
) -> Study:
    """Run a study of a shipped policy and write its report."""
    plan = make_plan(
        TransferTask(source, target),
        learner,
        learner_settings(learner),
        seeds=int(os.environ.get("SEEDS", seeds)),
        steps=steps,
        source_policy=POLICIES[policy],
        arms=arms,
    )
    study = run_study(
        plan,
        out,
        source_policy=POLICIES[policy],
        executor=Processes(int(os.environ.get("WORKERS", os.cpu_count() or 1))),
        command=f"python -m benchmarks.run {out.name}",
    )
    write_study_report(study, out)
    return study


def rows_of(study: Study, where: str) -> list[Row]:
    """Return the success of each arm next to its target; the nominal finger reaches all."""
    shares = {arm: successes(study, arm) for arm in study.plan.arms}
    adapted = [arm for arm in ("randomised", "identified") if arm in shares]
    best = max(adapted, key=lambda arm: float(shares[arm].mean()))
    limits = {"zero-shot": ("< 50 %", float(shares["zero-shot"].mean()) < _MILD)}
    wanted = ">= 80 %" + (", this or the other" if len(adapted) > 1 else "")
    limits[best] = (wanted, float(shares[best].mean()) >= _RECOVERED)
    seeds = study.plan.seeds
    return [
        Row(
            f"{where}, {arm}: targets reached within 5 mm",
            f"{np.mean(share):.0%}",
            f"{share_text(share)} over {seeds} fingers: "
            f"{', '.join(f'{each:.0%}' for each in share)}",
            *limits.get(arm, ("none", True)),
        )
        for arm, share in shares.items()
    ]
