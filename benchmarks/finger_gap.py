"""Transfer of a policy of the nominal finger to other fingers and to rigs.

The study equals `shapechanger transfer Finger Finger --target-options '{"gap": "real-like"}'
--source-policy ...` with the shipped policy; each seed has another finger. It is kept in
`results/finger-gap`, and finished runs are not repeated. The studies with `RemoteFinger-v1` and
`RemoteFingerTrack-v1`, on twins of a rig that the env serves itself, are kept in
`results/finger-rig` and `results/finger-follow`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.finger_learned import CIRCLE, TRACKS, played, trained
from benchmarks.finger_reach import FINGERS, TARGETS, Statics, held_by_controller
from benchmarks.row import Row, asked
from shapechanger.cli import main
from shapechanger.contract.env_ref import EnvRef
from shapechanger.files import read_json
from shapechanger.finger.env import SMOOTHNESS
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.reports.numbers import share_text
from shapechanger.transfer.executor import Processes
from shapechanger.transfer.learners.evaluation import evaluation_seed
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.presets import learner_settings
from shapechanger.transfer.plan import ARMS, Plan, Run, TransferTask
from shapechanger.transfer.report.study import write_study_report
from shapechanger.transfer.runs import RunResult, load_result
from shapechanger.transfer.study import STUDY_FILE, Study, make_plan, run_study

# Twenty minutes on a bench; arms are also evaluated after ten.
STEPS: Final = 61_440
# Steps of the arms that learn in simulated fingers; with half as many, `identified` reaches 85 %.
SIMULATED: Final = 614_400
RIGS: Final = 5
# Steps of the arms that learn in simulated fingers, for a rig.
RIG_SIMULATED: Final = 307_200
# Two minutes on a bench, for a comparison of arms that do not learn on the target.
FOLLOW_STEPS: Final = 6144
_FINGER: Final = EnvRef("shapechanger/Finger-v1")
# Zero-shot success below this counts as a gap.
_MILD: Final = 0.5
# Required success: of `identified` on a rig's twin and in process, and of `fine-tune` on both.
_RECOVERED: Final = 0.8
_RECOVERED_IN_GAP: Final = 0.9
_TUNED: Final = 0.7
# A mean over fingers hides weak ones, so each row also counts the fingers with at least this share.
_STRONG: Final = 0.8
_FOLLOWED: Final = 2.0  # Largest error on a rig's twin, as a multiple of the error in process.
# Time that the whole command may take for a finger, min.
_LIMIT_MIN: Final = 30.0
# Distance within which a target counts as reached, m; `Finger-v1` has the same.
_NEAR_M: Final = 0.005
_LATE: Final = {"parameters": {"command_delay": 0.010}}


_WHERE: Final = "fingers of the gap real-like"
_SCRATCH: Final = "scratch"
_IDENTIFIED: Final = "identified"
# Arms that learn in simulated fingers.
_SIMULATED_ARMS: Final = ("randomised", _IDENTIFIED)
_GAP_ARMS: Final = (*ARMS, *_SIMULATED_ARMS)
_RIG_ONLY: Final = "rig"

Shipped = Literal["reach", "track"]


def gap() -> list[Row]:
    """Measure each arm's success on fingers of the gap "real-like", and the causes of the gap.

    The shipped policy in the nominal finger with a delay shows the cost of a delay alone. A policy
    trained in the nominal finger with a rig's motors shows the cost of other arms and joints.
    `ONLY` names arms besides scratch and zero-shot, or "rig" for that policy. With `ENDED=1` no run
    is started, and the rows cover the runs that have ended.
    """
    target = _FINGER.having({"gap": "real-like"})
    out = Path("results", "finger-gap")
    plan, runs = _arms(target, out, FINGERS, SIMULATED)
    rows = [
        *rows_of(runs, _WHERE, {"identified": _RECOVERED_IN_GAP, "fine-tune": _TUNED}, SIMULATED),
        *_half_way(runs, _WHERE),
        *_chatter_rows(runs, _WHERE),
    ]
    if _IDENTIFIED in runs:
        rows += _ceiling(plan, runs[_IDENTIFIED], out)
    rows.append(_shipped_row("nominal finger with a delay of 10 ms", _FINGER.having(_LATE)))
    return [*rows, *_rig_only_rows(target, plan.seeds, _WHERE)]


def _arms(
    target: EnvRef, out: Path, fingers: int, simulated: int
) -> tuple[Plan, dict[str, list[RunResult]]]:
    """Run the requested arms, and return the plan and the runs that have ended, keyed by arm.

    Args:
        target: Env of the target fingers.
        out: Folder of the study.
        fingers: Number of seeds, each of which has another finger.
        simulated: Steps of arms that learn in simulated fingers.
    """
    wanted = asked("arm or row", (*_GAP_ARMS, _RIG_ONLY))
    # A study compares scratch with another arm, and zero-shot takes the least time.
    arms = tuple(arm for arm in _GAP_ARMS if arm in (*wanted, _SCRATCH, "zero-shot"))
    learns = any(arm in _SIMULATED_ARMS for arm in arms)
    source_steps = simulated if learns else None
    plan = _plan(target, "ppo-finger", arms, fingers, STEPS, source_steps=source_steps)
    if "ENDED" not in os.environ:
        _run(plan, out)
    return plan, _ended(plan, out)


def _half_way(runs: Mapping[str, list[RunResult]], where: str) -> list[Row]:
    """Return the success of the arms that learn on the target after half of their steps."""
    return [
        _share_row(f"{where}, {arm} after {STEPS // 2:,} steps", runs[arm], STEPS // 2)
        for arm in (_SCRATCH, "fine-tune")
        if arm in runs
    ]


def _rig_only_rows(target: EnvRef, fingers: int, where: str) -> list[Row]:
    """Return the success of a policy trained with only the rig's motors and delay, if requested."""
    if _RIG_ONLY not in asked("arm or row", (*_GAP_ARMS, _RIG_ONLY)):
        return []
    policy = load_policy(trained(_RIG_ONLY, 0))
    ends = [
        [
            info["is_success"]
            for info in played(policy, finger, TARGETS, evaluation_seed(finger, TARGETS))
        ]
        for finger in (target.having({"finger_seed": seed}) for seed in range(fingers))
    ]
    name = f"{where}, policy that knows the rig's motors and delay only"
    return [_row(name, dict(enumerate(np.mean(ends, axis=1))))]


def _shipped_row(where: str, env: EnvRef) -> Row:
    """Return the success of the shipped policy in an env."""
    reached = [info["is_success"] for info in played(load_policy(POLICIES["reach"]), env, TARGETS)]
    return Row(
        f"{where}: targets reached by the shipped policy",
        f"{np.mean(reached):.0%}",
        f"{TARGETS} targets",
        "none",
        True,
    )


def _ceiling(plan: Plan, identified: list[RunResult], out: Path) -> list[Row]:
    """Return how many targets each finger can hold, and how many controller and policy reach."""
    held, moved_to, controlled = (dict[int, NDArray[np.bool_]]() for _ in range(3))
    fingers = {seed: plan.task.target.having({"finger_seed": seed}) for seed in range(plan.seeds)}
    first = {seed: evaluation_seed(finger, TARGETS) for seed, finger in fingers.items()}
    for seed, finger in fingers.items():
        with finger.make() as env:
            inner: Any = env.unwrapped
            parameters: FingerParameters = inner.parameters
            targets = [
                env.reset(seed=first[seed] + i)[1]["target"]  # The targets of the runs.
                for i in range(TARGETS)
            ]
        statics = Statics(parameters)
        from_rest = [statics.distance_coming_from_rest(target) for target in targets]
        held[seed] = np.array([statics.distance(target) <= _NEAR_M for target in targets])
        moved_to[seed] = np.array(from_rest) <= _NEAR_M
        controlled[seed] = np.array(held_by_controller(parameters, first[seed], TARGETS))
    near, far = (list[bool]() for _ in range(2))
    for run in identified:
        seed = run.run.index
        policy = load_policy(run.run.policy_file(out))
        for info, is_near in zip(
            played(policy, fingers[seed], TARGETS, first[seed]), moved_to[seed], strict=True
        ):
            (near if is_near else far).append(bool(info["is_success"]))
    rows = {
        f"{_WHERE}: targets that some tensions hold within 5 mm": held,
        f"{_WHERE}: targets that the finger comes to from rest, against friction": moved_to,
        f"{_WHERE}, controller that knows the finger: targets reached within 5 mm": controlled,
    }
    return [
        *(_row(name, {s: float(r.mean()) for s, r in each.items()}) for name, each in rows.items()),
        Row(
            f"{_WHERE}, identified: reached of the targets that the finger comes to from rest",
            f"{np.mean(near):.0%}",
            f"{sum(near)} of {len(near)} over {len(identified)} fingers; {sum(far)} of the other "
            f"{len(far)}",
            "none",
            True,
        ),
    ]


def _row(name: str, shares: Mapping[int, float]) -> Row:
    """Return a row of the shares of reached targets, keyed by the seed of the finger.

    If the seeds are not 0, 1, 2 and so on, the row's name contains them. A row with another name
    does not replace an earlier row in the results.
    """
    values = np.array([*shares.values()])
    seeds = [*shares]
    if seeds != [*range(len(seeds))]:
        name += f", seeds {', '.join(map(str, seeds))}"
    each = ", ".join(f"{share:.0%}" for share in values)
    weak = ", ".join(str(seed) for seed, share in shares.items() if share < _STRONG)
    strong = int((values >= _STRONG).sum())
    spread = (
        f"{share_text(values)} over {len(values)} fingers: {each}; at least {_STRONG:.0%} on "
        f"{strong} of {len(values)} fingers{f', not on seeds {weak}' if weak else ''}"
    )
    return Row(name, f"{values.mean():.0%}", spread, "none", True)


def _share_row(name: str, runs: list[RunResult], steps: int | None = None) -> Row:
    """Return the row of the success of an arm's runs after some steps, by default after all."""
    ends = {
        run.run.index: next(e for e in reversed(run.curve) if steps in (None, e.steps))
        for run in runs
    }
    return _row(name, {seed: end.success or 0.0 for seed, end in ends.items()})


def _chatter_rows(runs: Mapping[str, list[RunResult]], where: str) -> list[Row]:
    """Return how much the policies of each arm change their commands, at the end of its runs."""
    rows: list[Row] = []
    for arm, ended in runs.items():
        changes = np.array([1.0 - run.curve[-1].measures[SMOOTHNESS.name] for run in ended])
        rows.append(
            Row(
                f"{where}, {arm}: mean change of a command per step, over its range",
                f"{changes.mean():.1%}",
                f"{changes.min():.1%} to {changes.max():.1%} over {len(changes)} fingers",
                "none",
                True,
            )
        )
    return rows


def rig() -> list[Row]:
    """Measure the arms of `gap` on twins of a rig; `ONLY` and `ENDED` mean the same as in `gap`."""
    target = EnvRef("shapechanger/RemoteFinger-v1", {"twin": "real-like"})
    out = Path("results", "finger-rig")
    plan, runs = _arms(target, out, RIGS, RIG_SIMULATED)
    where = "twins of a rig, real-like"
    nominal = EnvRef("shapechanger/RemoteFinger-v1", {"twin": "nominal"})
    return [
        *rows_of(runs, where, {"identified": _RECOVERED, "fine-tune": _TUNED}, RIG_SIMULATED),
        *_half_way(runs, where),
        *_chatter_rows(runs, where),
        _shipped_row("twin of a rig with the nominal finger", nominal),
        *_rig_only_rows(target, plan.seeds, where),
    ]


def command() -> list[Row]:
    """Time the command of docs/finger.md, with its default arms and steps, on two fingers."""
    out = Path("results", "finger-command")
    arguments = ["transfer", "Finger", "RemoteFinger", "--target-options", '{"twin": "real-like"}']
    workers = int(os.environ.get("WORKERS", os.cpu_count() or 1))
    main([*arguments, "--seeds", "2", "--workers", str(workers), "--out", str(out)])
    study = read_json(out / STUDY_FILE, Study, f"delete {out}")
    ends = {arm: [run.curve[-1].success or 0.0 for run in study.of(arm)] for arm in study.plan.arms}
    runs_min = sum(run.wall_s for run in study.runs) / 60.0
    minutes = runs_min / study.plan.seeds / workers
    reached = "; ".join(
        f"{arm} {' and '.join(f'{share:.0%}' for share in shares)}" for arm, shares in ends.items()
    )
    return [
        Row(
            "transfer Finger RemoteFinger, twin real-like: minutes a finger",
            f"{minutes:.0f} min",
            f"{runs_min:.0f} min of runs for {study.plan.seeds} fingers, {workers} at a time; "
            f"targets reached: {reached}",
            "< 30 min",
            minutes < _LIMIT_MIN,
        )
    ]


def follow() -> list[Row]:
    """Measure how closely policies that never saw a circle follow one on twins of a rig.

    Each policy learns other paths in the finger that was identified on its rig. The reference is
    the same policy on the circle in that simulated finger, because fingers of the gap have other
    motors and delays than the rig's servos.
    """
    source = EnvRef("shapechanger/FingerTrack-v1", {"path": "random"})
    circle = {"path": CIRCLE}
    target = EnvRef("shapechanger/RemoteFingerTrack-v1", {"twin": "real-like", **circle})
    out = Path("results", "finger-follow")
    arms = ("scratch", "zero-shot", "identified")
    plan = _plan(target, "ppo-rig", arms, RIGS, FOLLOW_STEPS, source=source, policy="track")
    _run(plan, out, policy="track")
    errors: list[tuple[float, float]] = []
    shipped: list[float] = []
    for seed in range(plan.seeds):
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


def _plan(
    target: EnvRef,
    learner: str,
    arms: tuple[str, ...],
    seeds: int,
    steps: int,
    *,
    source: EnvRef = _FINGER,
    policy: Shipped = "reach",
    source_steps: int | None = None,
) -> Plan:
    return make_plan(
        TransferTask(source, target),
        learner,
        learner_settings(learner),
        seeds=int(os.environ.get("SEEDS", seeds)),
        steps=steps,
        source_steps=source_steps,
        source_policy=POLICIES[policy],
        arms=arms,
    )


def _run(plan: Plan, out: Path, *, policy: Shipped = "reach") -> None:
    study = run_study(
        plan,
        out,
        source_policy=POLICIES[policy],
        executor=Processes(int(os.environ.get("WORKERS", os.cpu_count() or 1))),
        command=f"python -m benchmarks.run {out.name}",
    )
    write_study_report(study, out)


def _ended(plan: Plan, out: Path) -> dict[str, list[RunResult]]:
    """Return the runs that have ended, keyed by arm; arms without such runs are left out."""
    runs = {
        arm: [load_result(plan, out, Run(arm, index)) for index in range(plan.seeds)]
        for arm in plan.arms
    }
    ended = {arm: [run for run in each if run is not None] for arm, each in runs.items()}
    return {arm: each for arm, each in ended.items() if each}


def rows_of(
    runs: Mapping[str, list[RunResult]], where: str, least: Mapping[str, float], simulated: int
) -> list[Row]:
    """Return one row for each arm, with its final success.

    Args:
        runs: The runs, keyed by arm.
        where: Name of the target envs, for the rows.
        least: Required mean success, keyed by arm; other arms have no requirement.
        simulated: Steps of arms that learn in simulated fingers.
    """
    rows: list[Row] = []
    for arm, ended in runs.items():
        row = _share_row(f"{where}, {arm}: targets reached within 5 mm", ended)
        if arm in _SIMULATED_ARMS:
            row = replace(row, spread=f"{row.spread}; after {simulated:,} simulated steps")
        share = float(np.mean([run.curve[-1].success or 0.0 for run in ended]))
        if arm in least:
            row = replace(row, target=f">= {least[arm]:.0%}", met=share >= least[arm])
        elif arm == "zero-shot":
            row = replace(row, target="< 50 %", met=share < _MILD)
        rows.append(row)
    return rows
