"""`shapechanger policies`: list, show, play, evaluate, export, convert and share policies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import msgspec
import tyro
from rich.table import Table

from shapechanger.cli.acting import acting_in, load_any_policy
from shapechanger.cli.console import command_line, print_table, say
from shapechanger.cli.env_arguments import Body, EnvId, OwnLearner, opened
from shapechanger.cli.play import Watching
from shapechanger.contract.env_ref import EnvRef, HasHeldOutStarts, layouts_of, measures_of
from shapechanger.demos.cloning.onnx_policy import export_clone
from shapechanger.envs.catalogue import VEHICLE_ENVS, WAYPOINT_ENVS
from shapechanger.envs.naming import allow_own_modules, driven, env_ref
from shapechanger.errors import ShapechangerError, StudyError
from shapechanger.identity import identify_env
from shapechanger.own_modules import texts_in
from shapechanger.policy import kind_of
from shapechanger.transfer.identities import ENV, known, single_body
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate
from shapechanger.transfer.references import load_references
from shapechanger.vehicles.expert import PERIOD_S

if TYPE_CHECKING:
    from shapechanger.demos.cloning.card import CloneCard
    from shapechanger.transfer.learners.policy_file import PolicyCard, TrainedPolicy
    from shapechanger.transfer.onnx_policy import OnnxCard

_FILE_WIDTH: Final = 160


@dataclass(frozen=True)
class Show:
    """Print where a policy comes from, and what it senses and does."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, such as results/policies/Ant-v1.safetensors."""
    learner: OwnLearner = ""

    def run(self) -> None:
        """Print the card."""
        from shapechanger.transfer.learners.policy_file import TrainedPolicy  # PyTorch.

        policy: Any = load_any_policy(self.file, self.learner)
        card = policy.card
        lines = _lines(card)
        if hasattr(card, "observation"):
            lines |= {"version": card.version}
            if isinstance(policy, TrainedPolicy):
                lines["command"] = card.command or "not in this file"
                lines["normalised"] = "no" if policy.normalisation is None else "yes"
            lines["observation"] = ", ".join(card.observation.names)
            lines["action"] = ", ".join(card.action.names)
        for part, identity in card.identity.items():
            made_of = {"model": identity.model, **identity.files}
            shown = ", ".join(f"{name} {digest}" for name, digest in made_of.items() if digest)
            lines[f"{part} is of"] = shown
        for name, text in lines.items():
            say(f"{name:12} {text}")
        if (settings := getattr(card, "settings", None)) is not None:
            for name, value in msgspec.structs.asdict(settings).items():
                say(f"  {name:16} {value}")


def _lines(card: Any) -> dict[str, str]:
    """Return the facts of a policy's origin from its card, keyed by name."""
    return _card_lines(card) if hasattr(card, "observation") else _clone_lines(card)


def _card_lines(card: PolicyCard | OnnxCard) -> dict[str, str]:
    """Return the facts of a policy's origin, keyed by name."""
    explored: tuple[float, ...] | None = getattr(card, "start_log_std", None)
    return {
        "env": str(card.env),
        "learner": card.learner,
        "steps": f"{card.steps:,}",
        "seed": str(card.seed),
        **({} if explored is None else {"explored": _deviations(explored)}),
    }


def _deviations(log_std: tuple[float, ...]) -> str:
    """Return the standard deviations of the actions at the start of a fine-tuning."""
    low, high = math.exp(min(log_std)), math.exp(max(log_std))
    return f"standard deviations of {low:.2f} to {high:.2f} at the start"


def _clone_lines(card: CloneCard) -> dict[str, str]:
    """Return the facts of a clone's card, keyed by name."""
    actions = ("steering", "throttle") if card.action_layout is None else card.action_layout.names
    return {
        "env": str(card.data.get("env", "recorded")),
        "learner": "cloning",
        "steps": f"{card.steps:,}",
        "seed": ", ".join(map(str, card.seeds)),
        "version": card.version,
        "command": card.command,
        "picture": card.eyes,
        "state": "none" if card.state_layout is None else ", ".join(card.state_layout.names),
        "action": ", ".join(actions),
    }


@dataclass(frozen=True)
class ListPolicies:
    """List the policies in a folder and its subfolders."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")] = Path("results")
    """The folder."""
    references: bool = False
    """List the policies that ship instead, one for each env."""

    def run(self) -> None:
        """Print a line for each policy; a file that is not a policy gets its reason."""
        if self.references:
            self._print_references()
            return

        table = Table("file", "env", "learner", "steps", "seed", box=None)
        for path in sorted(self.folder.rglob("*.safetensors")):
            name = str(path.relative_to(self.folder))
            try:
                lines = _lines(load_any_policy(path).card)
            except ShapechangerError as error:
                table.add_row(name, str(error))
                continue
            table.add_row(name, *(lines[each] for each in ("env", "learner", "steps", "seed")))
        if not table.rows:
            raise StudyError(
                f"There is no policy in {self.folder}: train one, name a folder, or give "
                "--references for those that ship."
            )
        print_table(table, _FILE_WIDTH)

    def _print_references(self) -> None:
        """Print a line for each env, with its floor and what each seed reached."""
        table = Table("env", "learner", "steps", "measure", "no skill", "each seed", box=None)
        for env, reference in load_references().items():
            measure = next(iter(reference.ends))
            floor = max(values[measure] for values in reference.floor.values())
            ends = ", ".join(f"{value:.4g}" for value in reference.ends[measure])
            steps = f"{reference.steps:,}"
            table.add_row(env, reference.learner, steps, measure, f"{floor:.4g}", ends)
        print_table(table, _FILE_WIDTH)


@dataclass(frozen=True)
class EvaluatePolicy:
    """Play a policy for some episodes, and print its measures."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, or one that was exported as ONNX."""
    env: str = ""
    """Id of another env, if it acts through the body map of same names; by default the one of its
    training."""
    body: Body = ""
    learner: OwnLearner = ""
    episodes: int = 10
    """Number of episodes; they start like every evaluation's."""

    def run(self) -> None:
        """Evaluate."""
        if self.episodes < 1:
            raise StudyError("An evaluation takes at least one episode.")
        ref = _env_of(self.file, self.env, self.body, self.learner)
        with opened(ref) as env:
            acting, act = acting_in(
                env, self.file, self.learner, None if self.env or self.body else ref
            )
            if isinstance(env.unwrapped, HasHeldOutStarts):
                env.unwrapped.hold_out()
            found = evaluate(act, [acting], EVALUATION_SEED, episodes=self.episodes)
            for measure in measures_of(env):
                unit = "" if measure.unit == "1" else f" {measure.unit}"
                say(f"{measure.name:14} {found.value(measure.name):.4g}{unit}")
            if found.standing is not None:
                say(f"{'standing':14} {found.standing:.1%} of the steps")
            say(f"{'length':14} {found.mean_length:.4g} steps")


@dataclass(frozen=True)
class PlayPolicy(Watching):
    """Watch a policy in the env of its training, in a window or as a video."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, or one that was exported as ONNX."""
    env: str = ""
    """Id of another env, if it acts through the body map of same names; by default the one of its
    training."""
    body: Body = ""

    def run(self) -> None:
        """Play and print the returns."""
        ref = _env_of(self.file, self.env, self.body, self.learner)
        self.show(ref, self.file, trained_in=not (self.env or self.body))


def _env_of(file: Path, env: str, body: str, learner: str = "") -> EnvRef:
    """Return the env that is named, else the one in which a policy was trained."""
    if env:
        return driven(env_ref(env, body))
    # A policy of many bodies is seen in the family's own.
    trained_in = single_body(_trained_in(file, learner))
    # The env of a policy may be of the user's own, or have a task that is.
    allow_own_modules(trained_in.id, *texts_in(trained_in.kwargs))
    if body:
        if "path" not in trained_in.kwargs:
            return driven(env_ref(trained_in.id, body))
        return driven(trained_in.having({"body": body}))
    return driven(trained_in)


def _trained_in(file: Path, learner: str) -> EnvRef:
    """Return the env of a policy's card."""
    card: Any = load_any_policy(file, learner).card
    if hasattr(card, "env"):
        return card.env
    env = card.data.get("env")
    if env is None:
        raise StudyError(f"{file} learned from recordings of no env: name one with --env.")
    return env_ref(str(env))


@dataclass(frozen=True)
class ExportPolicy:
    """Export a policy for other programs, which need neither PyTorch nor Shapechanger."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, or a clone, which a robot then runs on board."""
    out: Path
    """The file to write, such as ant.onnx."""
    env: str = ""
    """Id of the env of the body that a policy of limbs is exported for; by
    default the one of its training. Other policies are exported for their own."""
    body: Body = ""
    learner: OwnLearner = ""
    format: Literal["onnx"] = "onnx"
    """Its format."""

    def run(self) -> None:
        """Write the file."""
        policy = load_any_policy(self.file, self.learner)
        kind = kind_of(self.file)
        if kind.endswith("onnx"):
            raise StudyError(f"{self.file} has been exported already.")
        if kind == "clone":
            body, control_hz = _learned_with(policy.card)
            export_clone(policy, self.out, body=body, control_hz=control_hz)
        else:
            self._export(policy)
        say(f"wrote {self.out}")

    def _export(self, policy: TrainedPolicy) -> None:
        """Write a policy that is no clone."""
        from shapechanger.transfer.export import export_limbs, export_onnx  # PyTorch.

        if "many bodies" in policy.card.settings.takes:
            ref = _env_of(self.file, self.env, self.body)
            with opened(ref) as env:
                export_limbs(policy, env, ref, self.out)
            return
        if self.env or self.body:
            raise StudyError(
                "Only a policy of limbs fits another body than its own: leave out --env and --body."
            )
        export_onnx(policy, self.out)


def _learned_with(card: CloneCard) -> tuple[str, float | None]:
    """Return the body and the rate of a clone's demonstrations, as far as its card tells."""
    env = card.data.get("env")
    if env is None:
        return str(card.data.get("body", "")), card.data.get("control_hz")
    # Waypoints are the same in all bodies.
    body, _ = VEHICLE_ENVS.get(str(env), ("", ""))
    return body, 1.0 / PERIOD_S if body or env in WAYPOINT_ENVS else None


@dataclass(frozen=True)
class Convert:
    """Convert a zip of PPO, SAC or TQC from Stable-Baselines3; loading it can run code from it."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A zip that the model's `save` wrote."""
    env: EnvId
    """Id of the env that it was trained in; its layouts must fit the policy's spaces."""
    out: Path
    """The file to write, such as mine.safetensors."""
    body: str = ""
    """Body that it was trained in: its name, or edits as JSON."""
    trust: bool = False
    """Required, because the zip holds pickled objects: give it only if you trust its author."""

    def run(self) -> None:
        """Convert the policy."""
        from shapechanger.transfer.learners.convert import convert_zip  # PyTorch.

        if not self.trust:
            raise StudyError(
                f"{self.file} may run code when it is loaded, because Stable-Baselines3 pickles: "
                "give --trust if you trust its author."
            )
        env = env_ref(self.env, self.body)
        with opened(env) as made:
            layouts, identity = layouts_of(made), known({ENV: identify_env(made, env.id).identity})
        convert_zip(self.file, env, layouts, identity, command_line()).save(self.out)
        say(f"wrote {self.out}")
