"""`shapechanger suite`: several studies with a joint table."""

from __future__ import annotations

import shlex
import sys
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import tyro
from rich.table import Table

from shapechanger.cli.console import Interrupted, StudyProgress, plain_console
from shapechanger.cli.env_arguments import driven, env_ref, require_seed
from shapechanger.cli.transfer import run_steps, write_study_report

if TYPE_CHECKING:
    from shapechanger.transfer.plan import TransferTask
    from shapechanger.transfer.suite import StudyOutcome

__all__ = ["Suite"]

_VEHICLES: Final = ("Car", "Tank", "Truck", "Boat")
_LENSES: Final = ("night", "glare", "blur", "dirt")
_SUMMARY: Final = "suite.json"
_STEPS_A_MINUTE: Final = 1200.0
_FILE_WIDTH: Final = 200


@dataclass(frozen=True)
class Suite:
    """Run a suite of studies: one study and report per pair, and a joint table.

    Run the same command again to resume, or with more seeds to add to it.
    """

    name: Annotated[Literal["vehicles", "lenses"], tyro.conf.Positional]
    """The twelve ordered pairs of car, tank, truck and boat; or the car with something wrong with
    its camera."""
    seeds: int = 5
    """Runs of each arm."""
    steps: int | None = None
    """Demonstrated steps on the target, 1,200 a minute; ten minutes if not given."""
    out: Path | None = None
    """The suite's folder; results/NAME if not given."""
    seed: int = 0
    """Number that the seeds of all runs are drawn from."""
    workers: int | None = None
    """Runs at a time; one for each core if not given."""

    def run(self) -> None:
        """Run the studies, write their reports, and print the joint table."""
        from shapechanger.transfer.executor import Processes
        from shapechanger.transfer.files import write_json
        from shapechanger.transfer.learners.settings import learner_settings
        from shapechanger.transfer.study import inspect_task, make_plan, unfinished_runs
        from shapechanger.transfer.suite import open_study_folder, run_in_suite, study_outcomes

        require_seed(self.seed)
        out = self.out or Path("results", self.name)
        command = shlex.join(["shapechanger", *sys.argv[1:]])
        # Files have no width; do not wrap tables in them.
        console = plain_console(width=None if sys.stdout.isatty() else _FILE_WIDTH)
        executor = Processes(self.workers)
        settings = learner_settings("cloning")
        found: list[StudyOutcome] = []
        for task in self._tasks():
            traits = inspect_task(task)
            plan = make_plan(
                task,
                "cloning",
                settings,
                seeds=self.seeds,
                steps=self.steps,
                source_steps=settings.steps if self.steps is None else self.steps,
                seed=self.seed,
                traits=traits,
            )
            try:
                folder = open_study_folder(plan, out)
                with StudyProgress(run_steps(plan, unfinished_runs(plan, folder))) as progress:
                    study = run_in_suite(
                        plan,
                        out,
                        executor=executor,
                        on_progress=progress,
                        command=command,
                        traits=traits,
                    )
            except KeyboardInterrupt:
                raise Interrupted(f"Stopped. Go on with: {command}") from None
            write_study_report(study, folder)
            found += study_outcomes([study])
            write_json(out / _SUMMARY, found)
            console.print(f"wrote {folder / 'report.html'}", soft_wrap=True)
        console.print(_table(found))
        console.print(
            "Gains are of fine-tuning over scratch, in scores (0: random actions, 1: what scratch "
            "ends with), with 95 % intervals over seeds.",
            soft_wrap=True,
        )
        halves = sum(crossing.halves for crossing in found)
        console.print(
            f"On {halves} of {len(found)} fine-tuning came to what scratch ends with in less than "
            "half of scratch's minutes.",
            soft_wrap=True,
        )

    def _tasks(self) -> list[TransferTask]:
        from shapechanger.transfer.plan import TransferTask

        if self.name == "vehicles":
            pairs = permutations(_VEHICLES, 2)
            return [TransferTask(driven(env_ref(a)), driven(env_ref(b))) for a, b in pairs]
        car = env_ref("Car")
        return [TransferTask(driven(car), driven(car, (lens,))) for lens in _LENSES]


def _table(found: list[StudyOutcome]) -> Table:
    """Format the results: returns and minutes, then gains with intervals."""
    from shapechanger.reports.numbers import estimate_text

    table = Table(
        *("study", "scratch", "zero-shot", "fine-tuned", "scratch, min", "fine-tune, min"),
        *("jumpstart", "total reward gain", "gain at the end"),
        box=None,
    )
    for crossing in found:
        tuned = crossing.fine_tune_steps
        table.add_row(
            crossing.name,
            f"{crossing.final:.1f}",
            "" if crossing.zero_shot is None else f"{crossing.zero_shot:.1f}",
            f"{crossing.fine_tuned:.1f}",
            f"{crossing.scratch_steps / _STEPS_A_MINUTE:.1f}",
            "never" if tuned is None else f"{tuned / _STEPS_A_MINUTE:.1f}",
            *(estimate_text(gain, signed=True) for gain in crossing.gains.values()),
        )
    return table
