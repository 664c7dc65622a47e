"""`shapechanger play | policies`: watch, show, evaluate, export and convert policies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import gymnasium as gym
import msgspec
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.table import Table

from shapechanger.cli.console import command_line, print_table, say
from shapechanger.cli.env_arguments import (
    Body,
    EnvId,
    OwnLearner,
    opened,
    policy_file,
)
from shapechanger.contract.env_ref import EnvRef, hold_out, layouts_of, measures_of
from shapechanger.envs.catalogue import (
    VEHICLE_ENVS,
    WAYPOINT_ENVS,
    allow_own_modules,
    driven,
    env_ref,
)
from shapechanger.envs.opengl import has_screen
from shapechanger.errors import ShapechangerError, StudyError, check_seed
from shapechanger.identity import identify_env, texts_in
from shapechanger.policy import STEERING, PolicyCard, load_policy
from shapechanger.reports.films import require_film, write_film
from shapechanger.transfer.body_map import BodyMap, Copy, MappedEnv
from shapechanger.transfer.identities import ENV, known, require_same_env
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, Act, evaluate, random_actions
from shapechanger.transfer.references import load_references
from shapechanger.vehicles.expert import PERIOD_S

POLICY_FILES = (".safetensors", ".onnx")
"""Suffixes of files of policies."""


@dataclass(frozen=True, kw_only=True)
class Watching:
    """Options of a command that shows episodes."""

    out: Path | None = None
    """A film to write instead of a window, such as ant.mp4; play.mp4 if there is no screen."""
    episodes: int = 1
    """Number of episodes."""
    seed: int = 0
    """Seed of the starts, and of random actions."""
    max_steps: int = 1000
    """Steps after which a shown episode ends."""
    learner: OwnLearner = ""

    def show(self, ref: EnvRef, policy: Path | None, *, trained_in: bool = False) -> None:
        """Show episodes in a window or write them as a film, and print the returns."""
        check_seed(self.seed, StudyError)
        if self.episodes < 1 or self.max_steps < 1:
            raise StudyError("--episodes and --max-steps must be at least 1.")
        out = self.out or (None if has_screen() else Path("play.mp4"))
        if out is not None:
            require_film(out)
            if self.out is None:
                say(f"There is no screen, so this writes {out}; drawing can take minutes.")
        frames: list[NDArray[Any]] = []
        with opened(ref, render_mode="human" if out is None else "rgb_array") as env:
            if policy is None:
                acting, act = env, random_actions(env.action_space, self.seed)
            else:
                acting, act = acting_in(env, policy, self.learner, ref if trained_in else None)
            for episode in range(self.episodes):
                observation, _ = acting.reset(seed=self.seed + episode)
                worth, steps, over, why = 0.0, 0, False, ""
                while not over and steps < self.max_steps:
                    action = act(np.asarray(observation)[None])[0]
                    observation, reward, terminated, truncated, info = acting.step(action)
                    worth, steps = worth + float(reward), steps + 1
                    over = terminated or truncated
                    if terminated and (reason := info.get("stop_reason")):  # Only vehicles have it.
                        why = f": {reason}"
                    if out is not None:
                        frames.append(cast("NDArray[Any]", env.render()))
                say(f"episode {episode}: return {worth:.1f} in {steps} steps{why}")
            if out is not None:
                write_film(frames, out, float(env.metadata["render_fps"]))
                say(f"wrote {out}")


@dataclass(frozen=True)
class Play(Watching):
    """Watch a policy in an env, in a window or as a video."""

    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")]
    """Id of the env, such as BigAnt; or the file of a policy, which is shown in the env that it was
    trained in."""
    policy: Path | None = None
    """A policy that `train`, a study or `policies export` has written, or `reference` for the one
    that ships for the env; random actions if not given. A policy for another body acts through the
    body map that matches names; a clone of demonstrations is refused if the actions differ."""
    body: Body = ""

    def run(self) -> None:
        if Path(self.env).suffix not in POLICY_FILES:
            ref = env_ref(self.env, self.body)
            self.show(ref, self.policy and policy_file(self.policy, ref))
            return
        if self.policy is not None:
            raise StudyError(
                f"{self.env} is a policy: give an env with --policy, or only the file."
            )
        file = Path(self.env)
        ref = _env_of(file, self.learner, "", self.body)
        self.show(ref, file, trained_in=not self.body)


def acting_in(
    env: gym.Env[Any, Any], file: Path, learner: str = "", trained_in: EnvRef | None = None
) -> tuple[gym.Env[Any, Any], Act]:
    """Return an env with the layouts of a policy, and the function that computes its actions."""
    policy = load_any_policy(file, learner)
    card: PolicyCard = policy.card
    if trained_in is not None and ENV in card.identity:
        remedy = (
            "Train it again, or name the env, to try the policy in its present version: --env ENV, "
            "or `shapechanger play ENV --policy FILE`."
        )
        now = identify_env(env, trained_in.id)
        require_same_env(card.identity, trained_in, now, file, remedy)
    if card.clone is None:
        return _fitting(env, card), policy.act
    if (layout := getattr(env.unwrapped, "action_layout", None)) is not None:
        card.require_layouts(layout, card.observation)
    return env, policy.act


def load_any_policy(file: Path, learner: str = "") -> Any:
    """Load a policy of any kind; its learner may be in a module of the user."""
    allow_own_modules(learner)
    return load_policy(file, learner)


def _fitting(env: gym.Env[Any, Any], card: PolicyCard) -> gym.Env[Any, Any]:
    """Return an env with a policy's layouts, through the body map that matches names if needed."""
    settings: Any = card.settings
    if settings is not None and "many bodies" in settings.takes:
        from shapechanger.transfer.limbs.envs import fitted  # PyTorch.

        return fitted(env, card.layouts[0], settings.room)
    (observation, action), mine = layouts_of(env), card.layouts
    if (observation, action) == mine:
        return env
    body_map = BodyMap.between(mine[0], observation, mine[1], action)
    entries = (*body_map.observation, *body_map.action)
    filled = [entry.feature for entry in entries if not isinstance(entry.rule, Copy)]
    if filled:
        say(f"Constant, because the other body has no counterpart: {', '.join(filled)}.")
    return MappedEnv(env, body_map)


@dataclass(frozen=True, kw_only=True)
class _OfPolicy:
    file: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")]
    """A policy, such as results/policies/Ant-v1.safetensors, a clone, or one exported as ONNX."""
    learner: OwnLearner = ""


@dataclass(frozen=True, kw_only=True)
class _InEnv(_OfPolicy):
    env: str = ""
    """Id of another env, in which the policy acts through the body map that matches names; if not
    given, the env that the policy was trained in."""
    body: Body = ""

    def ref(self) -> EnvRef:
        """Return the env that the user named, or else the one that the policy was trained in."""
        return _env_of(self.file, self.learner, self.env, self.body)


def _env_of(file: Path, learner: str, env_id: str, body: str) -> EnvRef:
    """Return the env that the user named, or else the one that a policy was trained in."""
    if env_id:
        return driven(env_ref(env_id, body))
    env = load_any_policy(file, learner).card.env
    if env is None:
        raise StudyError(
            f"{file} was trained on recordings that name no env: `shapechanger play ENV --policy "
            f"{file}` shows it in one, and other commands have --env."
        )
    # A policy for many bodies acts in the family's default body.
    trained_in = env.without("bodies")
    # The env, or its task, may come from a module of the user.
    allow_own_modules(trained_in.id, *texts_in(trained_in.kwargs))
    if body and "path" in trained_in.kwargs:
        return driven(trained_in.having({"body": body}))
    return driven(env_ref(trained_in.id, body) if body else trained_in)


@dataclass(frozen=True)
class PoliciesShow:
    """Show a policy's origin, layouts and settings, or list a folder's policies (.safetensors)."""

    path: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="PATH")] = Path("results")
    """A policy, a clone, or a folder, which is searched with its subfolders."""
    references: bool = False
    """List the shipped policies instead; not every env has one."""
    learner: OwnLearner = ""

    def run(self) -> None:
        if self.references:
            table = Table("env", "learner", "steps", "measure", "no skill", "each seed", box=None)
            for env, reference in load_references().items():
                measure = next(iter(reference.ends))
                floor = max(values[measure] for values in reference.floor.values())
                ends = ", ".join(f"{value:.4g}" for value in reference.ends[measure])
                steps = f"{reference.steps:,}"
                table.add_row(env, reference.learner, steps, measure, f"{floor:.4g}", ends)
            print_table(table)
        elif self.path.suffix in POLICY_FILES:
            _show(self.path, self.learner)
        else:
            table = Table("file", "env", "learner", "steps", "seed", box=None)
            for path in sorted(self.path.rglob("*.safetensors")):
                name = str(path.relative_to(self.path))
                try:
                    lines = origin_of(load_any_policy(path).card)
                except ShapechangerError as error:
                    table.add_row(name, str(error))
                    continue
                table.add_row(name, *(lines[each] for each in ("env", "learner", "steps", "seed")))
            if not table.rows:
                raise StudyError(
                    f"There is no policy in {self.path}: train one, name another folder, or give "
                    "--references for the shipped policies."
                )
            print_table(table)


def _show(file: Path, learner: str) -> None:
    policy = load_any_policy(file, learner)
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
            net, env = policy.net, policy.card.env
            if env is not None:  # Waypoints have the same meaning in all bodies.
                is_vehicle = env.id in VEHICLE_ENVS
                body = VEHICLE_ENVS[env.id].kwargs["vehicle"] if is_vehicle else ""
                control_hz = 1.0 / PERIOD_S if body or env.id in WAYPOINT_ENVS else None
                net = msgspec.structs.replace(net, body=body, control_hz=control_hz)
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
