"""What a study is to do, as a value: two studies with equal plans are one study."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, Literal

import msgspec
import numpy as np

from shapechanger.errors import StudyError, UnknownName
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners.settings import Settings

__all__ = [
    "ADAPTED_SOURCE_ARMS",
    "ARMS",
    "EVERY_ARM",
    "Arm",
    "Plan",
    "Run",
    "RunKind",
    "TransferTask",
]

Arm = Literal["scratch", "zero-shot", "fine-tune", "randomised", "identified"]
RunKind = Literal["source", "random"] | Arm

ARMS: Final[tuple[Arm, ...]] = ("scratch", "zero-shot", "fine-tune")
"""What every pair of envs can be compared by."""
ADAPTED_SOURCE_ARMS: Final[tuple[Arm, ...]] = ("randomised", "identified")
"""What is learned in a source that was made more like the target; see
`shapechanger.transfer.methods`."""
EVERY_ARM: Final[tuple[Arm, ...]] = (*ARMS, *ADAPTED_SOURCE_ARMS)
_KINDS: Final[tuple[RunKind, ...]] = ("source", "random", *EVERY_ARM)
# Welch's interval needs two of each; fewer than five are too wide to say much.
_FEWEST_SEEDS: Final = 2


class TransferTask(msgspec.Struct, frozen=True):
    """Learn in the source, move to the target.

    Attributes:
        source: The env that the policy is learned in.
        target: The env that it is moved to.
    """

    source: EnvRef
    target: EnvRef


class Plan(msgspec.Struct, frozen=True, kw_only=True):
    """All that decides the numbers of a study.

    Attributes:
        task: Source and target.
        body_map: How their layouts correspond.
        learner: Name of the learner.
        settings: Its settings, the same in every arm.
        steps: Target steps of each run of scratch and fine-tune.
        source_steps: Source steps that the source policies have cost, each.
        seeds: Runs of each arm.
        arms: The arms; scratch is always one, because everything is measured against it.
        seed: Number that the seeds of all runs are drawn from.
        source_policy: SHA-256 of the policy file that was brought along; empty if the study trains
            its own, one for each seed.
        last_k: How many of the last evaluations count as the end of a run.
        exclusive: Whether only one run at a time can have the target, as a robot.
        individual: The argument of the target that says which individual it is, of which each seed
            meets another one; empty if there is but one target.
        versions: Version of each package that the numbers depend on: a study that goes on with
            others would mix two kinds of numbers.

    Raises:
        StudyError: If there are fewer than two seeds, or nothing to compare.
    """

    task: TransferTask
    body_map: BodyMap
    learner: str
    settings: Settings
    steps: int
    source_steps: int
    seeds: int
    arms: tuple[Arm, ...] = ARMS
    seed: int = 0
    source_policy: str = ""
    last_k: int = 3
    exclusive: bool = False
    individual: str = ""
    versions: dict[str, str]

    def __post_init__(self) -> None:
        if self.seeds < _FEWEST_SEEDS:
            raise StudyError(
                f"A study needs at least {_FEWEST_SEEDS} seeds to say how sure it is, "
                f"got {self.seeds}."
            )
        for arm in self.arms:
            if arm not in EVERY_ARM:
                raise UnknownName("arm", arm, EVERY_ARM)
        if len(set(self.arms)) != len(self.arms):
            raise StudyError(f"Each arm is named once, got {', '.join(self.arms)}.")
        if "scratch" not in self.arms or len(self.arms) < 2:
            raise StudyError("A study compares scratch with at least one other arm.")

    def runs(self) -> tuple[Run, ...]:
        """Every run of the study, those that others wait for first."""
        brought = bool(self.source_policy)
        wanted: list[RunKind] = ["random", *(arm for arm in EVERY_ARM if arm in self.arms)]
        if not brought and {"zero-shot", "fine-tune"} & set(self.arms):
            wanted.insert(0, "source")
        # One policy that was brought along does the same in every run; one says it all.
        once = {"zero-shot"} if brought and not self.individual else set[str]()
        return tuple(
            Run(kind, i) for kind in wanted for i in range(1 if kind in once else self.seeds)
        )

    def seed_of(self, run: Run) -> int:
        """The seed of a run, independent of every other run's and of what else runs."""
        entropy = np.random.SeedSequence(self.seed, spawn_key=(_KINDS.index(run.kind), run.index))
        return int(entropy.generate_state(1)[0] >> 1)

    def target_of(self, run: Run) -> EnvRef:
        """The target of a run: where there are individuals, that of its index."""
        if not self.individual:
            return self.task.target
        return self.task.target.having({self.individual: run.index})

    def grows(self, other: Plan) -> bool:
        """Whether this is the other study with more seeds: what was done there counts here."""
        return self.seeds > other.seeds and msgspec.structs.replace(other, seeds=self.seeds) == self

    def difference(self, other: Plan) -> str:
        """Names of the fields in which two plans differ, for a message; empty if they are equal."""
        mine: dict[str, Any] = msgspec.structs.asdict(self)
        theirs: dict[str, Any] = msgspec.structs.asdict(other)
        return ", ".join(name for name in mine if mine[name] != theirs[name])


class Run(msgspec.Struct, frozen=True):
    """One training, or one evaluation: the unit of work, and of the statistics.

    Attributes:
        kind: What it does.
        index: Which of the seeds, from 0.
    """

    kind: RunKind
    index: int

    @property
    def name(self) -> str:
        """Its name, and that of its folder."""
        return f"{self.kind}-{self.index}"

    def folder(self, study: Path) -> Path:
        """Where it writes."""
        return study / "runs" / self.name
