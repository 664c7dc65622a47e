"""`shapechanger suite`: several studies with a joint table, described in a TOML file."""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import msgspec
import tyro
from rich.live import Live
from rich.table import Table

from shapechanger.cli.console import command_line, interruptible, plain_console, print_table, say
from shapechanger.cli.transfer import StudyRuns, run_showing_progress
from shapechanger.envs.catalogue import allow_own_modules, default_learner
from shapechanger.envs.suite_file import (
    SuiteFile,
    load_suite,
    located_errors,
    shipped_suites,
    suite_tasks,
)
from shapechanger.errors import FailedRuns, RenderError, StudyError, check_seed, require_known
from shapechanger.files import read_json, write_atomic, write_json
from shapechanger.registry import METHODS
from shapechanger.reports.numbers import interval_text
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.methods import load_method
from shapechanger.transfer.plan import (
    PLAN_FILE,
    SOURCE,
    Plan,
    TransferTask,
    planned_arms,
    read_plan,
)
from shapechanger.transfer.report.films import film_study
from shapechanger.transfer.report.study import write_study_report
from shapechanger.transfer.report.suite import FilmStrip, Sweep, suite_html
from shapechanger.transfer.runs import last_evaluation, load_result
from shapechanger.transfer.study import (
    STUDY_FILE,
    Study,
    TaskTraits,
    default_arms,
    inspect_task,
    looks_in,
    make_plan,
    run_study,
    unfinished_runs,
)
from shapechanger.transfer.suite import StudyOutcome, merge_study, open_study_folder, study_outcome

_SUMMARY: Final = "suite.json"
_FILM: Final = "film.mp4"


@dataclass(frozen=True, kw_only=True)
class SuiteRun(StudyRuns):
    """Run a suite of studies: one study and report per pair, and a joint page.

    Run the same command again to resume the suite; more --seeds add runs to it.
    """

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE")]
    """A TOML file, or the name of a suite that comes with Shapechanger: ants, lenses, methods,
    pendulums, replay, shank, vehicles or waypoints."""
    only: tuple[str, ...] = ()
    """Names of the studies to run, such as Ant-to-BigAnt; all if not given."""
    out: Path | None = None
    """The suite's folder; results/NAME if not given."""

    def run(self) -> None:
        page = _Page(self.name, self.out)
        given = {name: getattr(self, name) for name in ("seeds", "steps", "source_steps", "seed")}
        chosen = msgspec.structs.replace(
            page.suite, **{name: value for name, value in given.items() if value is not None}
        )
        check_seed(chosen.seed, StudyError)
        tasks = page.tasks
        require_known("study", tasks, *self.only)
        executor = self.made_executor()
        failed: list[str] = []
        for name in self.only or tasks:
            with located_errors(self.name):
                traits = inspect_task(tasks[name])
                plan = _plan(chosen, tasks[name], traits)
            try:
                folder = open_study_folder(plan, page.out, name)
                runs = unfinished_runs(plan, folder)
                with interruptible(lambda: f"Stopped. Go on with: {command_line()}"):
                    study = run_showing_progress(
                        plan, folder, runs, executor=executor, traits=traits
                    )
            except FailedRuns as error:
                if plan.exclusive:  # A robot is the target, and the next study would move it.
                    raise
                failed.append(f"{name}: {error}")
                continue
            page.add(name, study)
        _print_outcomes(page.outcomes())
        if failed:
            raise FailedRuns(" ".join(failed))


def _plan(suite: SuiteFile, task: TransferTask, traits: TaskTraits) -> Plan:
    learner, settings = resolve_learner(
        suite.learner or default_learner(task.target), suite.settings
    )
    return make_plan(
        task,
        learner,
        settings,
        seeds=suite.seeds,
        steps=suite.steps,
        source_steps=suite.source_steps,
        arms=suite.arms or default_arms(traits),  # pyright: ignore[reportArgumentType]
        seed=suite.seed,
        measure=suite.measure,
        traits=traits,
    )


@dataclass(frozen=True)
class SuiteWatch:
    """Watch a suite that another process runs: progress and last evaluations of its runs."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The suite's folder, such as results/ants."""
    every: float = 5.0
    """Seconds between updates in a terminal; the table is printed once to a file or pipe."""

    def run(self) -> None:
        if self.every <= 0.0:
            raise StudyError(f"--every must be above 0, got {self.every:g}.")
        table, complete = _progress_table(self.folder)
        if not sys.stdout.isatty():
            print_table(table)
            return
        with Live(table, console=plain_console(), auto_refresh=False) as live:
            while not complete:
                time.sleep(self.every)
                table, complete = _progress_table(self.folder)
                live.update(table, refresh=True)


@dataclass(frozen=True)
class SuiteMerge:
    """Merge folders of one suite that were run on several machines, and write its page."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SUITE")]
    """A TOML file, or the name of a suite that comes with Shapechanger."""
    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")]
    """The folders; a study may be in several of them, with different seeds and arms."""
    out: Path | None = None
    """The folder to write; results/NAME if not given."""

    def run(self) -> None:
        page = _Page(self.name, self.out)
        tasks, out = page.tasks, page.out
        if out.resolve() in [folder.resolve() for folder in self.folders]:
            raise StudyError(f"{out} is one of the folders to merge: give another --out.")
        for folder in self.folders:
            if not any((folder / name / PLAN_FILE).exists() for name in tasks):
                raise StudyError(f"{folder} holds no study of the suite {self.name}.")
        for name in tasks:
            parts = [one / name for one in self.folders if (one / name / PLAN_FILE).exists()]
            if not parts:
                continue
            plan = merge_study(parts, out / name)
            if missing := unfinished_runs(plan, out / name):
                say(f"{name} lacks {', '.join(run.name for run in missing)}.")
                continue
            study = run_study(
                plan,
                out / name,
                executor=Serial(),
                command=command_line(),
                looked=[look for part in parts for look in looks_in(part / STUDY_FILE)],
            )
            page.add(name, study)
        _print_outcomes(page.outcomes())


@dataclass(frozen=True)
class SuiteList:
    """List the suites that come with Shapechanger, and the methods that a study can compare."""

    def run(self) -> None:
        table = Table("suite", "studies", "seeds", "arms", box=None)
        for name in shipped_suites():
            suite = load_suite(name)
            studies = str(len(suite_tasks(suite)))
            table.add_row(name, studies, str(suite.seeds), ", ".join(suite.arms) or "the default")
        print_table(table)
        say("")
        table = Table("method", "what it does", "source", box=None)
        for name in METHODS.names():
            method = load_method(name)
            about = (type(method).__doc__ or "").strip().partition("\n")[0]
            table.add_row(name, about, method.paper)
        print_table(table)


def _progress_table(out: Path) -> tuple[Table, bool]:
    """Return a table with a row for each study in a folder, and whether all are complete."""
    table = Table("study", "runs", "steps", "at work", box=None)
    complete = True
    for path in sorted(out.glob(f"*/{PLAN_FILE}")):
        # Like the process that runs the suite, import methods from modules of the current folder.
        allow_own_modules(*planned_arms(path.parent))
        plan = read_plan(path.parent, f"{path.parent} is kept as it is")
        ended, done, total = 0, 0, 0
        at_work: list[str] = []
        for run in plan.runs():
            steps = plan.steps_of(run.kind)
            total += steps
            if load_result(plan, path.parent, run) is not None:
                ended, done = ended + 1, done + steps
            elif (last := last_evaluation(path.parent, run)) is not None:
                done += last.steps
                value = last.value(plan.measure if run.kind != SOURCE else "return")
                at_work.append(f"{run.name} {value:.4g} after {last.steps:,}")
        complete = complete and ended == len(plan.runs())
        share = f"{100 * done // max(total, 1)} %"
        table.add_row(path.parent.name, f"{ended} of {len(plan.runs())}", share, "; ".join(at_work))
    if not table.rows:
        raise StudyError(f"There is no study in {out}: name the folder of a suite.")
    return table, complete


class _Page:
    def __init__(self, name: str, out: Path | None) -> None:
        self.suite = load_suite(name)
        allow_own_modules(self.suite.learner, *self.suite.arms)
        with located_errors(name):
            self.tasks = dict(suite_tasks(self.suite))
        self.out = out or Path("results", Path(name).stem)
        self._strips: dict[str, list[FilmStrip]] = {}
        self._studies = {
            one: read_json(self.out / one / STUDY_FILE, Study, f"delete {self.out / one}")
            for one in self.tasks
            if (self.out / one / STUDY_FILE).exists()
        }

    def add(self, name: str, study: Study) -> None:
        """Add a study that has ended, or replace it; write its report and the page."""
        write_study_report(study, self.out / name)
        self._studies[name] = study
        for one in self._studies:
            if one not in self._strips or one == name:
                # Without a way to render, the page has no films.
                with suppress(RenderError):
                    folder = self.out / one
                    self._strips[one] = film_study(self._studies[one], folder, folder / _FILM)
        ordered, swept, sweep = self._ordered(), self.suite.sweep, None
        if swept and len(self.suite.sources) == 1 and not self.suite.targets:
            values = dict(zip(self.tasks, swept.values, strict=True))
            sweep = Sweep(
                f"{swept.field} of {swept.edit.get('edit', 'the edit')}",
                {one: values[one] for one in ordered},
            )
        page = suite_html(
            self.suite.name,
            ordered,
            seeds=self.suite.seeds,
            strips=self._strips,
            films={one: f"{one}/{_FILM}" for one, strips in self._strips.items() if strips},
            sweep=sweep,
        )
        path = self.out / "index.html"
        write_atomic(path, page.encode())
        write_json(self.out / _SUMMARY, self.outcomes())
        say(f"wrote {self.out / name / 'report.html'} and {path}")

    def outcomes(self) -> list[StudyOutcome]:
        """Return the outcome of each study, in the order of the suite."""
        return [study_outcome(name, study) for name, study in self._ordered().items()]

    def _ordered(self) -> dict[str, Study]:
        return {one: self._studies[one] for one in self.tasks if one in self._studies}


def _print_outcomes(found: list[StudyOutcome]) -> None:
    table = Table(
        *("study", "measure", "scratch", "zero-shot", "arm", "at its end", "scratch, steps"),
        *("arm, steps", "jumpstart", "total reward gain", "gain at the end"),
        box=None,
    )
    for outcome in found:
        steps = outcome.arm_steps
        table.add_row(
            outcome.name,
            outcome.measure,
            f"{outcome.final:.4g}",
            "" if outcome.zero_shot is None else f"{outcome.zero_shot:.4g}",
            outcome.arm,
            f"{outcome.arm_final:.4g}",
            f"{outcome.scratch_steps:,.0f}",
            "never" if steps is None else f"{steps:,.0f}",
            *(
                interval_text(gain.value, gain.low, gain.high, signed=True)
                for gain in outcome.gains.values()
            ),
        )
    print_table(table)
    halves = sum(outcome.halves for outcome in found)
    arms = " or ".join(dict.fromkeys(outcome.arm for outcome in found))
    say(
        f"Gains are of {arms} over scratch, in scores (0: no skill, 1: the target's reference, or "
        "the end of the best arm), with 95 % intervals over seeds.\n"
        f"On {halves} of {len(found)} pairs {arms} reached the final value of scratch in less than "
        "half of scratch's steps."
    )
