"""Ids and arguments of envs as values, and the properties of an env that transfer needs.

In addition to Gymnasium's interface, an env may have these attributes, which enable features:

- `observation_layout`, `action_layout` and `measures`: see `EnvTraits`.
- `demonstrator(seed)`: an expert for its task, a `TaskDemonstrator`; `seed` draws its mistakes.
- `taught_by(act, seed)`: a `TaskDemonstrator` that uses a policy of another env, whose id is
  `teacher_env`. `act` maps observations of that env, (n, k), to its actions, (n, m).
- `hold_out()`: makes later resets draw the surroundings from a set that training never uses.
- `family_name`: the continuous family of its body. `arguments_towards(target, alpha)` returns
  arguments for the body that lies at `alpha`, 0 to 1, between this body and the target's;
  `arguments_between(target)` returns arguments that draw such a body at each reset; and
  `drawn_bodies(count, seed, split)` returns bodies from a split of the family, as JSON.
- `tree`: the trunk and the limbs of its body, a `shapechanger.morphology.tree.Tree`.
- `randomised_source()`: arguments of a source env whose body is drawn from the bodies that this env
  may have. `identified_source(seed)`: arguments that are identified from motions of this env.
- `certify_shift(source, target)`: the certificate of the change between two envs.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import dataclass
from typing import Any, Final, Literal, Protocol

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import LayoutError, ShapechangerError, StudyError, UnknownName
from shapechanger.files import converted
from shapechanger.identity import Identity, identify_env
from shapechanger.layout import Layout


class EnvRef(msgspec.Struct, frozen=True):
    """An env's id and arguments, from which another process can make it.

    Attributes:
        id: A registered id, or `module:id` to import a module first.
        kwargs: Arguments of `gymnasium.make`; JSON values, such as a body as JSON text.
    """

    id: str
    kwargs: dict[str, Any] = {}

    def __str__(self) -> str:
        """Return the id and the arguments."""
        arguments = ", ".join(f"{name}={value}" for name, value in self.kwargs.items())
        return f"{self.id} ({arguments})" if arguments else self.id

    def having(self, more: Mapping[str, Any]) -> EnvRef:
        """Return the same env with additional or replaced arguments."""
        return EnvRef(self.id, {**self.kwargs, **more})

    def without(self, argument: str) -> EnvRef:
        """Return the same env without an argument."""
        return EnvRef(self.id, {name: v for name, v in self.kwargs.items() if name != argument})

    def make(self, **more: Any) -> gym.Env[Any, Any]:
        """Make the env.

        Args:
            **more: Arguments for this instance only, such as `render_mode`.

        Raises:
            UnknownName: If no env has this id.
            StudyError: If the env does not accept these arguments.
        """
        try:
            return gym.make(self.id, **{**self.kwargs, **more})
        except (gym.error.UnregisteredEnv, ModuleNotFoundError) as error:
            known = [name for name in gym.registry if name.startswith("shapechanger/")]
            raise UnknownName("environment", self.id, known) from error
        except TypeError as error:
            # Gymnasium adds this text if the constructor of the env refuses an argument.
            reason, refused, _ = str(error).partition(" was raised from the environment creator")
            if not refused:
                raise
            raise StudyError(f"{self.id} cannot be made with these options: {reason}.") from error


class BodyDraw(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Bodies to draw from a family: the argument `bodies` of an env with many bodies.

    Attributes:
        split: Part of the family: "train", "interpolation", "extrapolation" or "composition".
        count: Number of bodies.
        seed: Seed of the draws.
    """

    split: str = "train"
    count: int = 32
    seed: int = 0


def each_body(env: EnvRef) -> list[EnvRef]:
    """Return one env for each body in the argument `bodies` of an env.

    Args:
        env: An env; its argument `bodies` is a list of bodies as JSON, or a `BodyDraw` as a
            mapping. Without the argument, the result is the env itself.

    Raises:
        StudyError: If `bodies` is empty or not a valid `BodyDraw`, or the env has no family.
        UnknownName: If there is no such split, or the env of a `BodyDraw` does not exist.
        MorphologyError: If no bodies can be drawn from the family.
    """
    if "bodies" not in env.kwargs:
        return [env]
    one = env.without("bodies")
    given = env.kwargs["bodies"]
    if isinstance(given, Mapping):
        draw = converted(given, BodyDraw, StudyError, f"The bodies of {env.id} are wrong")
        with closing(one.make()) as made:
            body: Any = made.unwrapped
            if not hasattr(body, "drawn_bodies"):
                raise StudyError(f"The body of {env.id} belongs to no family to draw from.")
            given = body.drawn_bodies(draw.count, draw.seed, draw.split)
    if not given:
        raise StudyError(f"{env.id} needs at least one body.")
    return [one.having({"body": edits}) for edits in given]


class Measure(msgspec.Struct, frozen=True):
    """A performance metric of an episode; larger is better.

    The return often includes a reward for survival: an ant that stands still earns 1,000. A measure
    only quantifies skill. Envs declare their measures as the attribute `measures`; the first one is
    the default of a study.

    Attributes:
        name: Name, such as "forward speed".
        unit: Unit; "1" for a pure number.
        key: Key of the measured number in the step's `info`; empty for the return.
        over: "episode": the sum over the episode divided by the env's time limit, so that an
            episode that ends early counts as standing still for the rest; "end": the last value.
    """

    name: str
    unit: str
    key: str = ""
    over: Literal["episode", "end"] = "end"


RETURN: Final = Measure("return", "1")
FORWARD_SPEED: Final = Measure("forward speed", "m/s", "x_velocity", "episode")
SUCCESS: Final = Measure("success", "1", "is_success")


class TaskDemonstrator(Protocol):
    """An expert for the task of an env."""

    def begin(self) -> None:
        """Start an episode."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the intended action, which is to be learned, and the executed action."""
        ...


@dataclass(frozen=True, slots=True)
class EnvTraits:
    """Properties of an env, read once per study.

    Attributes:
        observation_layout: Meaning of an observation.
        action_layout: Meaning of an action.
        observation_space: Space of observations.
        action_space: Space of actions.
        exclusive: Whether only one run at a time may use the env, such as a robot.
        individual: Name of the argument that selects one of several robots; may be empty.
        has_demonstrator: Whether the env has an expert for its task.
        adapts_source: Whether the env has `identified_source`, and with it `randomised_source`.
        family: Name of the continuous family of the env's body; may be empty.
        measures: The performance metrics of a policy, the default first.
        identity: Identity of the env's robot and of its custom files.
    """

    observation_layout: Layout
    action_layout: Layout
    observation_space: gym.Space[Any]
    action_space: gym.Space[Any]
    exclusive: bool
    individual: str
    has_demonstrator: bool
    adapts_source: bool
    family: str
    measures: tuple[Measure, ...]
    identity: Identity

    def same_layouts(self, other: EnvTraits) -> bool:
        """Return whether another env has equal layouts."""
        mine, theirs = self.observation_layout, other.observation_layout
        return mine == theirs and self.action_layout == other.action_layout


def env_traits(env: gym.Env[Any, Any], env_id: str = "") -> EnvTraits:
    """Read the traits of an env.

    Args:
        env: The env.
        env_id: Id of the env, which may name a module.

    Raises:
        LayoutError: If the env publishes no layouts.
    """
    observation, action = layouts_of(env)
    inner = env.unwrapped
    return EnvTraits(
        observation,
        action,
        env.observation_space,
        env.action_space,
        exclusive=getattr(inner, "exclusive", False),
        individual=getattr(inner, "individual", ""),
        has_demonstrator=hasattr(inner, "demonstrator"),
        adapts_source=hasattr(inner, "identified_source"),
        family=getattr(inner, "family_name", ""),
        measures=measures_of(env),
        identity=identify_env(env, env_id),
    )


def hold_out(env: gym.Env[Any, Any]) -> None:
    """Make later resets of an env draw held-out surroundings, if the env has any."""
    getattr(env.unwrapped, "hold_out", lambda: None)()


def is_single_instance(env: gym.Env[Any, Any]) -> bool:
    """Return whether only one instance of an env can exist, such as of a robot."""
    return not getattr(env.unwrapped, "side_by_side", True)


def measures_of(env: gym.Env[Any, Any]) -> tuple[Measure, ...]:
    """Return the measures of an env, the default first; the return is always one of them."""
    declared: tuple[Measure, ...] = getattr(env.unwrapped, "measures", ())
    return declared if RETURN in declared else (*declared, RETURN)


def is_reward_term(name: str) -> bool:
    """Return whether a key of `info` is a reward term: `reward_...` or `..._penalty`."""
    return name.startswith("reward_") or name.endswith("_penalty")


def layouts_of(env: gym.Env[Any, Any]) -> tuple[Layout, Layout]:
    """Return the observation and the action layout of the outermost wrapper that publishes them.

    Raises:
        LayoutError: If neither a wrapper nor the env publishes layouts.
    """
    names = ("observation_layout", "action_layout")
    found = [env.get_wrapper_attr(n) for n in names if env.has_wrapper_attr(n)]
    layouts = [layout for layout in found if isinstance(layout, Layout)]
    if len(layouts) < len(names):
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise LayoutError(
            f"{name} publishes no observation_layout and action_layout, so the meaning of its "
            "numbers is unknown: add them to the env, as `shapechanger.Layout`s."
        )
    return layouts[0], layouts[1]


def certify_shift(source: gym.Env[Any, Any], target: gym.Env[Any, Any]) -> str:
    """Return the certificate of the change between two envs; empty if the source issues none.

    Raises:
        EmptyShift: If the envs behave the same.
        StudyError: If an env fails in the rollout that the certificate compares.
    """
    certify = getattr(source.unwrapped, "certify_shift", None)
    if certify is None:
        return ""
    try:
        return str(certify(source, target))
    except ShapechangerError:
        raise
    except (TypeError, ValueError, ArithmeticError) as error:
        names = " or ".join(env.spec.id if env.spec else str(env) for env in (source, target))
        raise StudyError(
            f"{names} fails in a short rollout ({error}): check the arguments of the env."
        ) from error
