"""`shapechanger transfer | methods`: a transfer study, and the methods that it can compare."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import tyro
from rich.table import Table

from shapechanger.cli.console import Interrupted, StudyProgress, command_line, print_table, say
from shapechanger.cli.env_arguments import (
    ClusterAddress,
    ExecutorKind,
    executor_of,
    options_of,
    policy_file,
    require_seed,
    settings_of,
)
from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import OWN_ROBOT
from shapechanger.envs.naming import allow_own_modules, default_learner, driven, env_ref
from shapechanger.errors import MapError, OutputError, StudyError
from shapechanger.files import read_text
from shapechanger.registry import METHODS
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.settings import study_budgets
from shapechanger.transfer.methods import load_method
from shapechanger.transfer.plan import Plan, Run, TransferTask
from shapechanger.transfer.report.study import write_study_report
from shapechanger.transfer.report.verdict import findings
from shapechanger.transfer.study import (
    default_arms,
    inspect_task,
    is_folder_of,
    make_plan,
    run_study,
    unfinished_runs,
)

if TYPE_CHECKING:
    from shapechanger.transfer.report.verdict import Findings
    from shapechanger.transfer.study import TaskTraits

# Divisor of the budget and number of seeds of --quick: enough to see that everything works.
_QUICK_DIVISOR: Final = 8
_QUICK_SEEDS: Final = 2
_FILE_WIDTH: Final = 120


@dataclass(frozen=True)
class Transfer:
    """Train in SOURCE, transfer to TARGET, and compare with training from scratch.

    Run the same command again to resume.
    """

    source: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Id of the env that the policy is learned in, such as Ant."""
    target: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TARGET")]
    """Id of the env that it is transferred to, such as ExtendedAnt."""
    seeds: int | None = None
    """Runs of each arm; 5 if not given."""
    steps: int | None = None
    """Target steps of a run; the learner's own number if not given."""
    source_steps: int | None = None
    """Source steps of a source policy; the learner's own number if not given: half as many as
    target steps, and more for a rig. With --source-policy, the steps of arms that train their own
    policy, such as identified."""
    quick: bool = False
    """Two seeds and an eighth of the steps: a check that everything works, not a result."""
    out: Path | None = None
    """The study's folder; results/SOURCE-to-TARGET if not given."""
    source_policy: Path | None = None
    """A given source policy, instead of training one for each seed: a file, or `reference` for the
    one that ships for the source."""
    source_body: str = ""
    """Another body of the source's family: its name, or edits as JSON."""
    target_body: str = ""
    """Another body of the target's family: its name, or edits as JSON."""
    target_lens: tuple[str, ...] = ()
    """Disturbances of a vehicle's target camera: night, glare, blur or dirt."""
    source_options: str = ""
    """More arguments of the source as JSON, such as '{"actions": "length"}'."""
    target_options: str = ""
    """The same of the target, such as '{"gap": "real-like"}' for a finger."""
    measure: str = ""
    """Quantity that policies are compared by: a measure of the target such as "forward speed", a
    reward term such as reward_forward, or return; the target's default if not given."""
    learner: str | None = None
    """Name of the learner's settings, a TOML file of them, or your class or function as
    module:name; by default the settings tuned for the target."""
    set: tuple[str, ...] = ()
    """Settings of the learner that replace its own, as NAME=VALUE: learning_rate=3e-4."""
    arms: tuple[str, ...] = ()
    """Methods to compare; scratch is required. `shapechanger methods` lists them, and module:name
    is a method that your module registers. The default is scratch, zero-shot and fine-tune;
    if the target is the same task in another finger, also randomised and identified."""
    rule: tuple[str, ...] = ()
    """Rules of the body map for entries without a partner, as NAME=RULE: "foot_*/motor=learn",
    "foot_*/motor=copy ankle_*/motor", "*/contact/*=zero", "ankle_4/angle=hold"."""
    map: Path | None = None
    """The body map as a TOML file, instead of --rule and --units."""
    units: Literal["same", "torque"] = "same"
    """Whether actions are mapped directly or by the torque that they produce."""
    seed: int = 0
    """Number that the seeds of all runs are drawn from."""
    executor: ExecutorKind = "processes"
    address: ClusterAddress = None
    workers: int | None = None
    """Runs at a time; one for each core if not given, and one where the target is a robot."""

    def run(self) -> None:
        """Run the study, print its table, and write its report."""
        self._require_sense()
        allow_own_modules(self.learner, *self.arms)
        task = self._task()
        learner, settings, steps = self._learner(task)
        # Budgets are refused before PyTorch is imported and envs are opened, which takes seconds.
        study_budgets(settings, steps, self.source_steps, is_given=bool(self.source_policy))

        # The report comes last; check its requirements before the work.
        import_module("shapechanger.reports.charts")

        traits = inspect_task(task)
        given = self.source_policy and policy_file(self.source_policy, task.source)
        plan = self._plan(task, learner, settings, steps, traits, given)
        _ = traits.shift  # An empty shift is refused before anything is written.
        executor = executor_of(self.executor, self.workers, self.address)
        out = self.out or Path("results", f"{_name(plan.task.source)}-to-{_name(plan.task.target)}")
        to_do = unfinished_runs(plan, out) if is_folder_of(plan, out) else plan.runs()
        if len(to_do) < len(plan.runs()):
            say(f"{len(plan.runs()) - len(to_do)} runs in {out} had ended before.")
        try:
            with StudyProgress(run_steps(plan, to_do)) as progress:
                study = run_study(
                    plan,
                    out,
                    source_policy=given,
                    executor=executor,
                    on_progress=progress,
                    command=command_line(),
                    traits=traits,
                )
        except KeyboardInterrupt:
            raise Interrupted(f"Stopped. {_way_on(plan, out)}".rstrip()) from None
        except OutputError as error:
            raise OutputError(f"{error} {_way_on(plan, out)}".rstrip()) from error
        found = findings(study)
        _print(found)
        report = write_study_report(study, out, found)
        say(f"\nwrote {out / 'study.json'} and {report}")

    def _require_sense(self) -> None:
        """Refuse contradictory or unused options."""
        require_seed(self.seed)
        twice = sorted({arm for arm in self.arms if self.arms.count(arm) > 1})
        if twice:
            raise StudyError(f"--arms names {', '.join(twice)} more than once.")
        if self.map and (self.rule or self.units != "same"):
            raise MapError(
                "The file of --map says all of the body map: leave out --rule and --units, or "
                "--map."
            )

    def _task(self) -> TransferTask:
        """Source and target, with their bodies and options."""
        source = driven(env_ref(self.source, self.source_body))
        target = driven(env_ref(self.target, self.target_body), self.target_lens)
        return TransferTask(
            source.having(options_of(self.source_options, "--source-options")),
            target.having(options_of(self.target_options, "--target-options")),
        )

    def _learner(self, task: TransferTask) -> tuple[str, LearnerSettings, int | None]:
        """Return the learner's name, its settings, and the steps in the target if they are set."""
        learner, settings = resolve_learner(
            self.learner or default_learner(task.target), settings_of(self.set)
        )
        if not self.quick:
            return learner, settings, self.steps
        shortest = settings.whole_updates(settings.steps // _QUICK_DIVISOR)
        settings = settings.for_budget(shortest)
        return learner, settings, shortest if self.steps is None else self.steps

    def _plan(
        self,
        task: TransferTask,
        learner: str,
        settings: LearnerSettings,
        steps: int | None,
        traits: TaskTraits,
        given: Path | None,
    ) -> Plan:
        """The plan of the study."""
        try:
            map_text = read_text(self.map) if self.map else ""
        except (OSError, ValueError) as error:
            raise MapError(f"The body map {self.map} cannot be read: {error}.") from error
        seeds = _QUICK_SEEDS if self.quick and self.seeds is None else self.seeds
        return make_plan(
            task,
            learner,
            settings,
            seeds=5 if seeds is None else seeds,
            steps=steps,
            source_steps=self.source_steps,
            source_policy=given,
            arms=self.arms or default_arms(traits),
            seed=self.seed,
            rules=dict(_split_rule(rule) for rule in self.rule),
            map_text=map_text,
            units=self.units,
            measure=self.measure,
            traits=traits,
        )


@dataclass(frozen=True)
class Methods:
    """List the transfer methods that a study can compare."""

    def run(self) -> None:
        """Print a table."""
        table = Table("method", "what it does", "source", box=None)
        for name in METHODS.names():
            method = load_method(name)
            about = (type(method).__doc__ or "").strip().partition("\n")[0]
            table.add_row(name, about, method.paper)
        print_table(table)


def run_steps(plan: Plan, runs: Iterable[Run]) -> dict[str, int]:
    """Return the steps of each run for the progress; an evaluation counts as one."""
    return {run.name: max(1, plan.steps_of(run.kind)) for run in runs}


def _split_rule(text: str) -> tuple[str, str]:
    """Split NAME=RULE."""
    name, equals, rule = text.partition("=")
    if not (name and equals and rule):
        raise MapError(f"A rule is written NAME=RULE, such as 'foot_*/motor=learn', not {text!r}.")
    return name, rule


def _name(env: EnvRef) -> str:
    """Return a short folder name."""
    if env.id == OWN_ROBOT:
        return Path(env.kwargs["path"]).stem
    return env.id.split("/")[-1].removesuffix("-v1")


def _way_on(plan: Plan, out: Path) -> str:
    """Tell how to resume an interrupted study; empty if it had not started."""
    if not is_folder_of(plan, out):
        return ""
    if len(unfinished_runs(plan, out)) == len(plan.runs()):
        return f"No run had ended; begin again with: {command_line()}"
    return f"Runs that had ended are kept in {out}; go on with: {command_line()}"


def _print(found: Findings) -> None:
    """Print the table of measures and the verdict."""
    table = Table("arm", "measure", "in target steps", "in total steps", "unit", box=None)
    # Measures that are undefined for an arm, such as zero-shot, are in the report with the reason.
    for row in [row for row in found.measures if row.target != "undefined"]:
        table.add_row(row.arm, row.measure, row.target, row.total, row.unit)
    print_table(table, _FILE_WIDTH)
    say(f"\n{found.verdict}")
    if found.other_arms:
        say(found.other_arms)
    for sentence in found.weak:
        say(sentence)
