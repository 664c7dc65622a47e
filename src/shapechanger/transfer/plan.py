"""The plan of a study as a value: two studies with equal plans are the same study."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from shapechanger.contract.env_ref import RETURN, EnvRef
from shapechanger.errors import StudyError, UnknownName, check_seed
from shapechanger.files import read_json
from shapechanger.identity import Identity
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.methods import load_method

PLAN_FILE: Final = "plan.json"
ARMS: Final = ("scratch", "zero-shot", "fine-tune")
"""Arms that are available for every pair of envs."""
SOURCE: Final = "source"
"""Kind of the runs that train a source policy."""
NO_SKILL: Final = ("random", "zero-action")
"""Kinds of the runs without a policy, which define the zero of scores."""
# The seeds of a kind of run derive from its index in this tuple; the seeds of other methods derive
# from their names.
_KINDS: Final = (SOURCE, "random", *ARMS, "randomised", "identified", "zero-action")
# Welch's interval needs two seeds of each arm.
_MIN_SEEDS: Final = 2


class TransferTask(msgspec.Struct, frozen=True):
    """The two envs of a transfer.

    Attributes:
        source: The env that the policy is trained in.
        target: The env that the policy is transferred to.
    """

    source: EnvRef
    target: EnvRef


class Plan(msgspec.Struct, frozen=True, kw_only=True):
    """Everything that determines the numbers of a study.

    Attributes:
        task: Source and target.
        body_map: Map between the layouts of source and target.
        measure: Quantity by which runs are compared: the name of a measure of the target, of one of
            its reward terms, or "return".
        unit: Unit of the measure.
        learner: Name of the learner.
        settings: Settings of the learner, the same in every arm.
        steps: Target steps of each run of an arm that learns on the target, such as scratch.
        source_steps: Training steps of each source policy.
        own_steps: Training steps of methods that train their own policy in the source, such as
            identified, if a source policy is given; 0 for `source_steps`.
        seeds: Number of runs of each arm; 1 for zero-shot with a given policy and a single target.
        arms: Names of the methods to compare; scratch must be among them, because all others are
            compared with it.
        seed: The seed from which the seeds of all runs are drawn.
        source_policy: SHA-256 of the given policy file; empty if the study trains one for each
            seed.
        last_k: Number of final evaluations that count as the end of a run.
        exclusive: Whether only one run at a time may use the target, such as a robot.
        individual: Argument of the target that selects an individual, a different one for each
            seed; empty if there is only one target.
        versions: Version of each package that the numbers depend on; a study cannot be resumed
            with other versions.
        identity: Identities of source, target, learner and methods, see
            `shapechanger.transfer.runs`; a study cannot be resumed with other identities.

    Raises:
        StudyError: If there are fewer than two seeds, scratch or a second arm is missing, an arm is
            named twice, or the seed is not a whole number from 0 to 2^32 - 1.
        UnknownName: If an arm is not the name of a method.
    """

    task: TransferTask
    body_map: BodyMap
    measure: str = RETURN.name
    unit: str = RETURN.unit
    learner: str
    settings: LearnerSettings
    steps: int
    source_steps: int
    own_steps: int = 0
    seeds: int
    arms: tuple[str, ...] = ARMS
    seed: int = 0
    source_policy: str = ""
    last_k: int = 3
    exclusive: bool = False
    individual: str = ""
    versions: dict[str, str]
    identity: dict[str, Identity]

    def __post_init__(self) -> None:
        check_seed(self.seed, StudyError)
        if self.seeds < _MIN_SEEDS:
            raise StudyError(
                f"A study needs at least {_MIN_SEEDS} seeds for its intervals, got {self.seeds}."
            )
        for arm in self.arms:
            load_method(arm)
        if len(set(self.arms)) != len(self.arms):
            raise StudyError(f"Each arm must be named once, got {', '.join(self.arms)}.")
        if "scratch" not in self.arms or len(self.arms) < 2:
            raise StudyError("A study compares scratch with at least one other arm.")

    def runs(self) -> tuple[Run, ...]:
        """Return every run of the study, each after the runs that it depends on."""
        given = bool(self.source_policy)
        wanted = [*NO_SKILL, *self.arms]
        if not given and any(load_method(arm).uses_source_policy for arm in self.arms):
            wanted.insert(0, SOURCE)
        # A given policy has the same result in every run; one run of the zero action is enough.
        once = set[str]() if self.individual else {"zero-action"}
        if given and not self.individual:
            once.add("zero-shot")
        return tuple(
            Run(kind, i) for kind in wanted for i in range(1 if kind in once else self.seeds)
        )

    def seed_of(self, run: Run) -> int:
        """Return the seed of a run, which does not depend on the other runs or their number."""
        known = run.kind in _KINDS
        kind = _KINDS.index(run.kind) if known else zlib.crc32(run.kind.encode())
        entropy = np.random.SeedSequence(self.seed, spawn_key=(kind, run.index))
        return int(entropy.generate_state(1)[0] >> 1)

    def target_of(self, run: Run) -> EnvRef:
        """Return the target of a run; if there are several individuals, its index selects one."""
        if not self.individual:
            return self.task.target
        return self.task.target.having({self.individual: run.index})

    def last_step_of(self, kind: str) -> int:
        """Return the step of the last evaluation of a kind of run."""
        if kind == SOURCE:
            return self.source_steps
        return self.steps if kind not in NO_SKILL and load_method(kind).learns_on_target else 0

    def source_steps_of(self, kind: str) -> int:
        """Return the source steps of the policy that an arm starts from or trains itself."""
        own = self.own_steps and not load_method(kind).uses_source_policy
        return self.own_steps if own else self.source_steps

    def trains(self, kind: str) -> bool:
        """Return whether a kind of run trains a policy."""
        return kind == SOURCE or (kind not in NO_SKILL and load_method(kind).trains)

    def steps_of(self, kind: str) -> int:
        """Return the training steps of a kind of run, in the source or the target."""
        if not self.trains(kind):
            return 0
        return self.last_step_of(kind) or self.source_steps_of(kind)

    def extends(self, other: Plan) -> bool:
        """Return whether this plan only adds seeds or arms to the other one.

        This plan then includes the runs of the other one, because no run depends on another arm.
        """
        added = {f"method {arm}" for arm in {*self.arms} - {*other.arms}}
        identity = {part: each for part, each in self.identity.items() if part in added}
        grown = msgspec.structs.replace(
            other, seeds=self.seeds, arms=self.arms, identity=other.identity | identity
        )
        more = self.seeds >= other.seeds and set(self.arms) >= set(other.arms)
        return more and grown == self != other

    def difference(self, other: Plan) -> str:
        """Return the names of the fields in which two plans differ; empty if they are equal."""
        mine: dict[str, Any] = msgspec.structs.asdict(self)
        theirs: dict[str, Any] = msgspec.structs.asdict(other)
        return ", ".join(name for name in mine if mine[name] != theirs[name])


class Run(msgspec.Struct, frozen=True):
    """One training or one evaluation, which is one sample in the statistics.

    The kind is a method, "source", "random" or "zero-action"; `index` counts the seeds from 0.
    """

    kind: str
    index: int

    @property
    def name(self) -> str:
        """Name of the run, and of its folder."""
        return f"{self.kind.replace(':', '.')}-{self.index}"

    def folder(self, study: Path) -> Path:
        """Folder of the run inside a study's folder."""
        return study / "runs" / self.name

    def policy_file(self, study: Path) -> Path:
        """File of the run's policy inside a study's folder."""
        return self.folder(study) / "policy.safetensors"


class _PlannedArms(msgspec.Struct):
    """The arms of a plan, read before their methods are imported."""

    arms: tuple[str, ...] = ()


def planned_arms(out: Path, remedy: str = "it is kept as it is") -> tuple[str, ...]:
    """Return the names of the methods of the study in a folder, without importing them."""
    return read_json(out / PLAN_FILE, _PlannedArms, remedy).arms


def read_plan(out: Path, remedy: str) -> Plan:
    """Read the plan of the study in a folder."""
    for arm in planned_arms(out, remedy):
        try:
            load_method(arm)
        except UnknownName as error:
            raise StudyError(
                f"{out} compares the method {arm}, whose module is not found from {Path.cwd()}: go "
                "to the folder that the study was started in, or install the method; no file was "
                f"changed. {error}"
            ) from error
    return read_json(out / PLAN_FILE, Plan, remedy)
