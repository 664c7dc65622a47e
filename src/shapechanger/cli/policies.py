"""`shapechanger policies`: list, show, play, evaluate, export, convert, push and pull policies."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import tyro
from rich.table import Table

from shapechanger import hub
from shapechanger.cli.console import command_line, print_table, say
from shapechanger.cli.env_arguments import (
    Body,
    EnvId,
    OwnLearner,
    Public,
    RepoName,
    Revision,
    opened,
)
from shapechanger.cli.play import Watching, acting_in, load_any_policy
from shapechanger.contract.env_ref import EnvRef, hold_out, layouts_of, measures_of
from shapechanger.envs.catalogue import (
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
    allow_own_modules,
    driven,
    env_ref,
)
from shapechanger.errors import HubError, PolicyError, ShapechangerError, StudyError
from shapechanger.files import require_file, write_atomic
from shapechanger.identity import identify_env, texts_in
from shapechanger.policy import MAX_BYTES, STEERING, CloneNetwork, PolicyCard, load_policy
from shapechanger.transfer.identities import ENV, known
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate
from shapechanger.transfer.references import load_references
from shapechanger.vehicles.expert import PERIOD_S


@dataclass(frozen=True, kw_only=True)
class _OfPolicy:
    """Options of a command for one policy."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, such as results/policies/Ant-v1.safetensors, a clone, or one exported as ONNX."""
    learner: OwnLearner = ""


@dataclass(frozen=True, kw_only=True)
class _InEnv(_OfPolicy):
    """Options of a command for a policy in an env."""

    env: str = ""
    """Id of another env, in which the policy acts through the body map that matches names; if not
    given, the env that the policy was trained in."""
    body: Body = ""

    def ref(self) -> EnvRef:
        """Return the env that the user named, or else the one that the policy was trained in."""
        if self.env:
            return driven(env_ref(self.env, self.body))
        env = load_any_policy(self.file, self.learner).card.env
        if env is None:
            raise StudyError(f"{self.file} was trained on recordings that name no env: give --env.")
        # A policy for many bodies is shown in the family's default body.
        trained_in = env.without("bodies")
        # The env, or its task, may come from a module of the user.
        allow_own_modules(trained_in.id, *texts_in(trained_in.kwargs))
        if self.body and "path" in trained_in.kwargs:
            return driven(trained_in.having({"body": self.body}))
        return driven(env_ref(trained_in.id, self.body) if self.body else trained_in)


@dataclass(frozen=True, kw_only=True)
class PoliciesShow(_OfPolicy):
    """Print a policy's origin, observation and action."""

    def run(self) -> None:
        policy = load_any_policy(self.file, self.learner)
        card: PolicyCard = policy.card
        lines = {**origin_of(card), "command": card.command or "not in this file"}
        if explored := card.start_log_std:
            low, high = math.exp(min(explored)), math.exp(max(explored))
            lines["explored"] = f"standard deviations of {low:.2f} to {high:.2f} at the start"
        if hasattr(policy, "normalisation"):
            lines["normalised"] = "no" if policy.normalisation is None else "yes"
        if card.clone is not None:
            lines["image"] = card.clone.eyes
        lines["observation"] = ", ".join(card.observation.names) if card.observation else "none"
        lines["action"] = ", ".join(card.action.names if card.action else STEERING)
        for part, identity in card.identity.items():
            made_of = {"model": identity.model, **identity.files}
            shown = ", ".join(f"{name} {digest}" for name, digest in made_of.items() if digest)
            lines[f"{part} digest"] = shown
        for name, text in lines.items():
            say(f"{name:12} {text}")
        if card.settings is not None:
            for name, value in msgspec.structs.asdict(card.settings).items():
                say(f"  {name:16} {value}")


def origin_of(card: PolicyCard) -> dict[str, str]:
    """Return the origin of a policy from its card: env, learner, steps, seed and version."""
    return {
        "env": str(card.env or "recorded"),
        "learner": card.learner,
        "steps": f"{card.steps:,}",
        "seed": str(card.seed),
        "version": card.version,
    }


@dataclass(frozen=True)
class PoliciesList:
    """List the policies in a folder and its subfolders."""

    folder: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")] = Path("results")
    """The folder."""
    references: bool = False
    """List the shipped policies instead, one for each env."""

    def run(self) -> None:
        if self.references:
            _print_references()
            return
        table = Table("file", "env", "learner", "steps", "seed", box=None)
        for path in sorted(self.folder.rglob("*.safetensors")):
            name = str(path.relative_to(self.folder))
            try:
                lines = origin_of(load_any_policy(path).card)
            except ShapechangerError as error:
                table.add_row(name, str(error))
                continue
            table.add_row(name, *(lines[each] for each in ("env", "learner", "steps", "seed")))
        if not table.rows:
            raise StudyError(
                f"There is no policy in {self.folder}: train one, name another folder, or give "
                "--references for the shipped policies."
            )
        print_table(table)


def _print_references() -> None:
    table = Table("env", "learner", "steps", "measure", "no skill", "each seed", box=None)
    for env, reference in load_references().items():
        measure = next(iter(reference.ends))
        floor = max(values[measure] for values in reference.floor.values())
        ends = ", ".join(f"{value:.4g}" for value in reference.ends[measure])
        steps = f"{reference.steps:,}"
        table.add_row(env, reference.learner, steps, measure, f"{floor:.4g}", ends)
    print_table(table)


@dataclass(frozen=True, kw_only=True)
class PoliciesEvaluate(_InEnv):
    """Run a policy for some episodes, and print its measures."""

    episodes: int = 10
    """Number of episodes; every evaluation uses the same starts."""

    def run(self) -> None:
        if self.episodes < 1:
            raise StudyError(f"--episodes must be at least 1, got {self.episodes}.")
        ref = self.ref()
        with opened(ref) as env:
            acting, act = acting_in(
                env, self.file, self.learner, None if self.env or self.body else ref
            )
            hold_out(env)
            found = evaluate(act, [acting], EVALUATION_SEED, episodes=self.episodes)
            for measure in measures_of(env):
                unit = "" if measure.unit == "1" else f" {measure.unit}"
                say(f"{measure.name:14} {found.value(measure.name):.4g}{unit}")
            if found.standing is not None:
                say(f"{'standing':14} {found.standing:.1%} of the steps")
            say(f"{'length':14} {found.mean_length:.4g} steps")


@dataclass(frozen=True, kw_only=True)
class PoliciesPlay(_InEnv, Watching):
    """Watch a policy in the env that it was trained in, in a window or as a video."""

    def run(self) -> None:
        self.show(self.ref(), self.file, trained_in=not (self.env or self.body))


@dataclass(frozen=True, kw_only=True)
class PoliciesExport(_InEnv):
    """Export a policy for other programs, which need neither PyTorch nor Shapechanger.

    Exported clones can run on a robot's computer. --env and --body select the body that a limb
    policy is exported for; other policies are exported for the body that they were trained on.
    """

    out: Path
    """The file to write, such as ant.onnx."""
    format: Literal["onnx"] = "onnx"
    """Format of the exported file."""

    def run(self) -> None:
        policy = load_any_policy(self.file, self.learner)
        if self.file.suffix == ".onnx":
            raise StudyError(f"{self.file} has been exported already.")
        if policy.card.clone is not None:
            body, control_hz = _learned_with(policy.card, policy.card.clone)
            net = msgspec.structs.replace(policy.net, body=body, control_hz=control_hz)
            policy.carded(clone=net).export(self.out)
        else:
            from shapechanger.transfer.export import export_limbs, export_onnx  # PyTorch.

            if "many bodies" in policy.card.settings.takes:
                ref = self.ref()
                with opened(ref) as env:
                    export_limbs(policy, env, ref, self.out)
            elif self.env or self.body:
                raise StudyError(
                    "Only a limb policy can be exported for another body: leave out --env and "
                    "--body."
                )
            else:
                export_onnx(policy, self.out)
        say(f"wrote {self.out}")


def _learned_with(card: PolicyCard, net: CloneNetwork) -> tuple[str, float | None]:
    """Return the body and the rate of a clone's demonstrations, as far as its card has them."""
    if card.env is None:
        return net.body, net.control_hz
    # Waypoints have the same meaning in all bodies.
    body = VEHICLE_ENVS[card.env.id].kwargs["vehicle"] if card.env.id in VEHICLE_ENVS else ""
    return body, 1.0 / PERIOD_S if body or card.env.id in WAYPOINT_ENVS else None


@dataclass(frozen=True)
class PoliciesConvert:
    """Convert a zip of PPO, SAC or TQC from Stable-Baselines3; loading it can run code from it."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A zip file that the `save` method of the model has written."""
    env: EnvId
    out: Path
    """The file to write, such as mine.safetensors."""
    body: Body = ""
    trust: bool = False
    """Required, because the zip holds pickled objects: give it only if you trust its author."""

    def run(self) -> None:
        from shapechanger.transfer.learners.policy_file import convert_zip  # PyTorch.

        if not self.trust:
            raise StudyError(
                f"{self.file} may run code when it is loaded, because Stable-Baselines3 pickles: "
                "give --trust if you trust its author."
            )
        env = env_ref(self.env, self.body)
        with opened(env) as made:
            layouts, identity = layouts_of(made), known({ENV: identify_env(made, env.id)})
        convert_zip(self.file, env, layouts, identity, command_line()).save(self.out)
        say(f"wrote {self.out}")


@dataclass(frozen=True)
class PoliciesPush:
    """Upload a policy to the Hugging Face Hub, with a card that describes it."""

    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, or a clone."""
    repo: RepoName
    """Name of the repository, such as ada/ant; it is made if it does not exist."""
    public: Public = False

    def run(self) -> None:
        card = _policy_card(self.file, self.repo)
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / hub.POLICY).symlink_to(self.file.resolve())
            address = hub.push(Path(folder), card, self.repo, "policy", public=self.public)
        say(f"pushed {self.file} to {address}")


@dataclass(frozen=True)
class PoliciesPull:
    """Download a policy from the Hugging Face Hub; nothing else of the repository is read."""

    repo: RepoName
    """Name of a repository that `policies push` has filled, such as ada/ant."""
    out: Path
    """The file to write, such as ant.safetensors; it must not exist yet."""
    revision: Revision = ""

    def run(self) -> None:
        if self.out.exists():
            raise HubError(f"{self.out} exists already: choose another name, or move it away.")
        with tempfile.TemporaryDirectory() as folder:
            commit = hub.pull(
                self.repo, "policy", Path(folder), revision=self.revision, max_bytes=MAX_BYTES
            )
            path = Path(folder) / hub.POLICY
            try:
                env = origin_of(load_policy(path).card)["env"]
            except PolicyError as error:
                raise HubError(
                    str(error).replace(str(path), f"{path.name} of {self.repo}")
                ) from error
            require_file(self.out)
            write_atomic(self.out, path.read_bytes())
        say(f"wrote {self.out}: {env}, revision {commit}")


def _policy_card(file: Path, repo: str) -> str:
    card = load_policy(file).card
    rows: dict[str, object] = {**origin_of(card), "SHA-256": hub.sha256_of(file)}
    seen = "" if card.clone is None else f"image ({card.clone.eyes})"
    done = ", ".join(STEERING)
    return hub.readme(
        repo,
        ["reinforcement-learning"],
        f"A policy of Shapechanger for `{rows['env']}`.",
        rows,
        {
            "Observation": hub.features_text(card.observation, seen),
            "Action": hub.features_text(card.action, done),
        },
        card.command,
        f"shapechanger policies pull {repo} --out policy.safetensors\n"
        "shapechanger policies play policy.safetensors",
    )
