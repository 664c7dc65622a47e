"""`shapechanger demos train | evaluate`: learn a policy from demonstrations and evaluate it."""

from __future__ import annotations

import io
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

import numpy as np
import tyro
from msgspec.structs import replace

from shapechanger.cli.console import NO_POLICY, StudyProgress, command_line, interruptible, say
from shapechanger.demos.clone_report import outlook, write_report
from shapechanger.demos.cloning.clone import ShrunkFrames, load_clone, settings_for
from shapechanger.demos.cloning.evaluation import EvaluationResult, evaluate
from shapechanger.demos.dataset import Dataset, count_steps, load_dataset
from shapechanger.errors import DemosError, OutputError, StudyError, check_seed
from shapechanger.files import require_file, write_atomic
from shapechanger.transfer.executor import use_one_thread
from shapechanger.transfer.learners.presets import LEARNERS
from shapechanger.vehicles.cameras.rectify import CameraGeometry, CanonicalView
from shapechanger.vehicles.waypoints import SteeringResponse, as_waypoints

if TYPE_CHECKING:
    from shapechanger.demos.cloning.learn import MemberCheck
    from shapechanger.demos.cloning.network import CameraPolicy
    from shapechanger.vehicles.cloning import CloningSettings


@dataclass(frozen=True, kw_only=True)
class _Waypoints:
    """Options for converting a recording of steering to waypoints."""

    camera: tuple[float, float] | None = None
    """Pitch and vertical field of view of the camera, degrees, for waypoints; read from the
    recording if not given."""
    response: tuple[float, float] | None = None
    """Turn of the vehicle at full steering for waypoints, rad/m and rad/s; fitted to the recorded
    motion if not given."""

    def view(self) -> CanonicalView:
        """Return how images are warped to the virtual camera."""
        return CanonicalView(None if self.camera is None else CameraGeometry(*self.camera))

    def converted(self, data: Dataset, view: CanonicalView) -> tuple[Dataset, SteeringResponse]:
        """Return the recording with waypoints as actions, and the response that was used."""
        given = None if self.response is None else SteeringResponse(*self.response)
        shown = as_waypoints(data, given)
        for note in (view.note(), *shown.notes):
            say(note)
        return shown.data, shown.response


@dataclass(frozen=True)
class DemosTrain(_Waypoints):
    """Clone a driver from demonstrations; write the policy and a report."""

    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A recording, one episode of it, or anything that `demos import` reads."""
    out: Path
    """The file to write, such as policy.safetensors; policy.html and policy.json go next to it."""
    head: Literal["auto", "class", "regression"] = "auto"
    """Output: one of the demonstrated actions (up to 16), or numbers; auto chooses by the data."""
    inputs: Literal["auto", "picture", "state", "both"] = "auto"
    """Input; by default frames if there are any, else the state."""
    split: Literal["time", "episode"] = "time"
    """Held-out data: the last steps in time, or the last complete episodes."""
    held_out: float = 0.2
    """Share of the steps that the policy is evaluated on and does not learn from; 0 for none."""
    waypoints: bool = False
    """Learn waypoints instead of steering and throttle; any vehicle can follow waypoints:
    shapechanger play TankWaypoint --policy ..."""
    seed: int = 0
    """Seed of all randomness."""
    sac: Path | None = None
    """Also write the policy as a file that `stable_baselines3.SAC.load` reads, to continue with
    reinforcement learning."""
    ppo: Path | None = None
    """Also write the policy as a file that `stable_baselines3.PPO.load` reads."""

    def run(self) -> None:
        self._require_files()
        from shapechanger.demos.cloning.examples import evaluated_steps  # PyTorch.
        from shapechanger.demos.cloning.learn import learn  # PyTorch.

        view = None
        if self.waypoints:
            if self.head == "class" or self.inputs in {"state", "both"}:
                raise DemosError(
                    "Waypoint policies map images to numbers: leave out --head and --inputs."
                )
            view = self.view()
        elif self.camera is not None or self.response is not None:
            raise DemosError("--camera and --response need --waypoints.")
        settings = settings_for(round((1.0 - self.held_out) * count_steps(self.data)))
        if view is not None:
            settings = cast("CloningSettings", LEARNERS["waypoint"]).clone
        if settings.members > 1:
            use_one_thread()  # More threads slow down networks this small.
        shrinking = ShrunkFrames(settings.framing, view)
        data = load_dataset(self.data, shrink=shrinking)
        origin: dict[str, Any] = {}
        if view is not None:
            data, response = self.converted(data, view)
            origin = {"response": astuple(response)}
        evaluated = evaluated_steps(data.episodes, self.split, self.held_out)
        learned = ~evaluated
        n = int(learned.sum())
        say(f"{n} steps to learn from, {len(data) - n} to evaluate on")
        with interruptible(lambda: NO_POLICY):
            names = [f"network {member + 1}" for member in range(settings.members)]
            with StudyProgress(dict.fromkeys(names, settings.steps(n))) as progress:

                def on_check(check: MemberCheck) -> None:
                    if check.member:  # The previous network has ended.
                        progress(names[check.member - 1], check.step, True)
                    progress(names[check.member], check.step, False)

                policy, training = learn(
                    data.part(learned),
                    settings=settings,
                    head="regression" if view is not None else self.head,
                    inputs=self.inputs,
                    seed=self.seed,
                    on_check=on_check,
                )
        say(training.mirror_note)
        body = "" if view is not None else data.body
        net = replace(policy.net, body=body, control_hz=data.control_hz)
        origin = {
            "data": str(self.data),
            "digest": shrinking.digest(data.actions),
            "learned_s": n / len(data) * data.duration_s,
            "steps": len(data),
            "rate_jitter": round(data.rate_jitter, 4),
            **origin,
        }
        policy = policy.carded(clone=net, command=command_line(), data=origin)
        note = (
            f"It is evaluated on the last {len(data) - n} of {len(data)} steps, which are unseen."
        )
        if not evaluated.any():
            evaluated = learned
            note = "It is evaluated on the steps that it learned from: expect less on others."
        shown = data.part(evaluated)
        evaluation = evaluate(policy, shown)
        policy.save(self.out)
        self._write_for_sb3(policy, shrinking.size)
        page = self.out.with_suffix(".html")
        numbers = write_report(page, self.out.name, policy, shown, evaluation, training, note)
        say(f"wrote {self.out}, {page} and {numbers}")
        say(note)
        if ahead := outlook(policy.card):
            say(ahead)
        _print_evaluation(evaluation)

    def _require_files(self) -> None:
        check_seed(self.seed, StudyError)
        written = [self.out, self.out.with_suffix(".html"), self.out.with_suffix(".json")]
        written += [path for path in (self.sac, self.ppo) if path is not None]
        for path in written:
            if written.count(path) > 1:
                raise OutputError(f"Cannot write two files to {path}: give each its own name.")
            require_file(path)

    def _write_for_sb3(self, policy: CameraPolicy, size: tuple[int, int] | None) -> None:
        if self.sac is None and self.ppo is None:
            return
        from shapechanger.demos.cloning.sb3 import as_ppo, as_sac  # PyTorch.

        for path, make in ((self.sac, as_sac), (self.ppo, as_ppo)):
            if path is not None:
                whole = io.BytesIO()  # Stable-Baselines3 would write incrementally, to FILE.zip.
                make(policy, size, seed=self.seed).save(whole)
                write_atomic(path, whole.getvalue())
                say(f"wrote {path}")


def _print_evaluation(evaluation: EvaluationResult) -> None:
    constant = f"{evaluation.majority_baseline:.3f}"
    say(f"{evaluation.steps} steps; the best constant action has an accuracy of {constant}")
    if evaluation.head == "class":
        for name, row in zip(evaluation.classes, evaluation.confusion, strict=True):
            if sum(row):
                right = row[evaluation.classes.index(name)]
                say(f"  {name}: {right} of {sum(row)} right")
        say(f"calibration error {evaluation.ece or 0.0:.3f}")
    else:
        for name, error in zip(evaluation.numbers, evaluation.errors, strict=False):
            say(f"  {name}: mean absolute error {error:.3f}")
        say(f"share within {evaluation.tolerance:g} of half the range: {evaluation.within:.3f}")
        say(
            "accuracy counts steps whose numbers all fall in the driver's third of their range, "
            "such as left, straight or right"
        )
    say(f"macro-F1 {evaluation.macro_f1:.3f}")
    say(f"accuracy {evaluation.accuracy:.3f}")


@dataclass(frozen=True)
class DemosEvaluate(_Waypoints):
    """Compare a policy with a driver's demonstrations; the last line is the accuracy."""

    policy: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")]
    """A policy that `demos train` or `train` wrote."""
    data: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DATA")]
    """A recording, one episode of it, or anything that `demos import` reads."""
    report: Path | None = None
    """An HTML page to write, with the worst frames; its numbers are written next to it as JSON."""

    def run(self) -> None:
        policy = load_clone(self.policy)
        layout = policy.card.action
        has_waypoints = layout is not None and layout.names[0].startswith("waypoint/")
        view = self.view() if has_waypoints else None
        shrinking = ShrunkFrames(policy.net.framing, view)
        data = load_dataset(self.data, shrink=shrinking)
        if view is not None and view.rectifiers:
            data, _ = self.converted(data, view)
        evaluation = evaluate(policy, data)
        note = f"The policy is evaluated on the {len(data)} steps of {self.data}."
        learned = policy.card.steps
        if policy.card.data.get("digest") == shrinking.digest(data.actions):
            note = f"The policy learned from the first {learned} of these {len(data)} steps."
            if learned < len(data):
                unseen = evaluate(policy, data.part(np.arange(len(data)) >= learned))
                note += f" On the others its accuracy is {unseen.accuracy:.3f}."
            say(note)
        if self.report is not None:
            require_file(self.report)
            numbers = write_report(
                self.report, self.policy.name, policy, data, evaluation, None, note
            )
            say(f"wrote {self.report} and {numbers}")
        _print_evaluation(evaluation)
