"""`shapechanger transfer`: run a transfer study."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Literal

from rich.table import Table

from shapechanger.cli.console import StudyProgress, command_line, interruptible, print_table, say
from shapechanger.cli.env_arguments import Learner, Settings, TwoEnvs, policy_file, settings_of
from shapechanger.envs.catalogue import allow_own_modules, default_learner, short_name
from shapechanger.errors import MapError, OutputError, StudyError, check_seed
from shapechanger.files import read_toml
from shapechanger.transfer.executor import Executor, Processes
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.settings import study_budgets
from shapechanger.transfer.plan import Plan, Run, TransferTask
from shapechanger.transfer.report.study import write_study_report
from shapechanger.transfer.report.verdict import measure_rows, other_arms, verdict, weak_individuals
from shapechanger.transfer.study import (
    Study,
    default_arms,
    inspect_task,
    is_folder_of,
    make_plan,
    run_study,
    unfinished_runs,
)

# Divisor of the budget and number of seeds of --quick: enough to see that everything works.
_QUICK_DIVISOR: Final = 8
_QUICK_SEEDS: Final = 2


@dataclass(frozen=True, kw_only=True)
class StudyRuns:
    """Options of a command that runs studies; None for the default of the study or the suite."""

    seeds: int | None = None
    """Runs of each arm; the suite's number, or 5, if not given."""
    steps: int | None = None
    """Target steps of a run; the suite's or the learner's number if not given."""
    source_steps: int | None = None
    """Source steps of a source policy; the suite's or the learner's number if not given. The
    learner's number is half of the target steps, and more for a finger rig. With --source-policy,
    they apply to arms that train another source policy, such as identified."""
    seed: int | None = None
    """Number that the seeds of all runs are drawn from; the suite's number, or 0, if not given."""
    executor: Literal["processes", "ray"] = "processes"
    """Whether runs are executed in processes of this machine or on a Ray cluster."""
    address: str | None = None
    """Address of the Ray cluster: 10.0.0.1:6379 or auto; Ray on this machine if not given."""
    workers: int | None = None
    """Number of runs at a time; one for each core by default, or one if the target is a robot."""

    def made_executor(self) -> Executor:
        """Return the executor of the runs."""
        if self.executor == "ray":
            if self.workers is not None:
                raise StudyError(
                    "Ray executes one run on each core of its nodes: leave out --workers."
                )
            from shapechanger.transfer.ray_executor import RayCluster  # An extra.

            return RayCluster(self.address)
        if self.address is not None:
            raise StudyError("--address needs --executor ray.")
        return Processes(self.workers)


def run_showing_progress(plan: Plan, folder: Path, runs: Iterable[Run], **more: Any) -> Study:
    """Run a study and show its progress; `runs` are the runs that have not ended yet."""
    # A run without training, which is only evaluated, counts as one step.
    with StudyProgress({run.name: max(1, plan.steps_of(run.kind)) for run in runs}) as progress:
        return run_study(plan, folder, on_progress=progress, command=command_line(), **more)


@dataclass(frozen=True, kw_only=True)
class Transfer(TwoEnvs, StudyRuns):
    """Train in SOURCE, transfer to TARGET, and compare with training from scratch.

    Run the same command again to resume.
    """

    quick: bool = False
    """Check that all works, with two seeds and an eighth of the steps unless they are given."""
    out: Path | None = None
    """The study's folder; results/SOURCE-to-TARGET if not given."""
    source_policy: Path | None = None
    """A source policy to use instead of training one for each seed: a file, or `reference` for the
    shipped policy of the source."""
    target_lens: tuple[str, ...] = ()
    """Disturbances of a vehicle's target camera: night, glare, blur or dirt."""
    measure: str = ""
    """Quantity that policies are compared by: a measure of the target such as "forward speed", a
    reward term such as reward_forward, or return; the target's default if not given."""
    learner: Learner = ""
    set: Settings = ()
    arms: tuple[str, ...] = ()
    """Methods to compare, as `shapechanger suite list` lists them; scratch is required. module:name
    is a method that your module registers. The default is scratch, zero-shot and fine-tune; if the
    target is the same task in another finger, also randomised and identified."""
    rule: tuple[str, ...] = ()
    """Rules of the body map for entries without a partner, as NAME=RULE: "foot_*/motor=learn",
    "foot_*/motor=copy ankle_*/motor", "*/contact/*=zero", "ankle_4/angle=hold"."""
    map: Path | None = None
    """The body map as a TOML file, instead of --rule and --units."""
    units: Literal["same", "torque"] = "same"
    """Whether actions are mapped directly or by the torque that they produce."""

    def run(self) -> None:
        seed = check_seed(self.seed or 0, StudyError)
        if twice := sorted({arm for arm in self.arms if self.arms.count(arm) > 1}):
            raise StudyError(f"--arms names {', '.join(twice)} more than once.")
        if self.map and (self.rule or self.units != "same"):
            raise MapError(
                "The file of --map defines the whole body map: leave out --rule and --units, "
                "or leave out --map."
            )
        allow_own_modules(self.learner, *self.arms)
        task = TransferTask(*self.refs(studied=True, lenses=self.target_lens))
        learner, settings = resolve_learner(
            self.learner or default_learner(task.target), settings_of(self.set)
        )
        steps, seeds = self.steps, 5 if self.seeds is None else self.seeds
        if self.quick:
            shortest = settings.whole_updates(settings.steps // _QUICK_DIVISOR)
            settings = settings.for_budget(shortest)
            steps = shortest if steps is None else steps
            seeds = _QUICK_SEEDS if self.seeds is None else seeds
        # Check budgets first, because importing PyTorch and opening envs takes seconds.
        study_budgets(settings, steps, self.source_steps, is_given=bool(self.source_policy))

        # The report comes last; check its requirements before the work.
        import_module("shapechanger.reports.charts")

        map_text = read_toml(self.map, "body map", ())[0] if self.map else ""
        traits = inspect_task(task)
        given = self.source_policy and policy_file(self.source_policy, task.source)
        plan = make_plan(
            task,
            learner,
            settings,
            seeds=seeds,
            steps=steps,
            source_steps=self.source_steps,
            source_policy=given,
            arms=self.arms or default_arms(traits),
            seed=seed,
            rules=dict(_split_rule(rule) for rule in self.rule),
            map_text=map_text,
            units=self.units,
            measure=self.measure,
            traits=traits,
        )
        executor = self.made_executor()
        out = self.out or Path("results", f"{short_name(self.source)}-to-{short_name(self.target)}")
        to_do = unfinished_runs(plan, out) if is_folder_of(plan, out) else plan.runs()
        if len(to_do) < len(plan.runs()):
            say(f"{len(plan.runs()) - len(to_do)} runs in {out} had ended before.")
        try:
            with interruptible(lambda: f"Stopped. {_way_on(plan, out)}".rstrip()):
                study = run_showing_progress(
                    plan, out, to_do, source_policy=given, executor=executor, traits=traits
                )
        except OutputError as error:
            raise OutputError(f"{error} {_way_on(plan, out)}".rstrip()) from error
        _print(study)
        report = write_study_report(study, out)
        say(f"\nwrote {out / 'study.json'} and {report}")


def _split_rule(text: str) -> tuple[str, str]:
    name, equals, rule = text.partition("=")
    if not (name and equals and rule):
        raise MapError(f"A rule must be NAME=RULE, such as 'foot_*/motor=learn', got {text!r}.")
    return name, rule


def _way_on(plan: Plan, out: Path) -> str:
    """Return how to resume an interrupted study; empty if it had not started."""
    if not is_folder_of(plan, out):
        return ""
    return f"Runs that had ended are kept in {out}; go on with: {command_line()}"


def _print(study: Study) -> None:
    table = Table("arm", "measure", "in target steps", "in total steps", "unit", box=None)
    # Measures that are undefined for an arm, such as zero-shot, are in the report with the reason.
    for row in [row for row in measure_rows(study) if row.target != "undefined"]:
        table.add_row(row.arm, row.measure, row.target, row.total, row.unit)
    print_table(table)
    say(f"\n{verdict(study)}")
    for sentence in filter(None, (other_arms(study), *weak_individuals(study))):
        say(sentence)
