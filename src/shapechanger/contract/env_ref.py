"""Envs as values, and the facts that transfer reads from an env."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, cast, runtime_checkable

import gymnasium as gym
import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.measure import RETURN, Measure
from shapechanger.errors import LayoutError, ShapechangerError, StudyError, UnknownName
from shapechanger.identity import IdentifiedEnv, identify_env
from shapechanger.layout import Layout


class EnvRef(msgspec.Struct, frozen=True):
    """An env's id and arguments, from which another process can make it.

    Attributes:
        id: A registered id, or `module:id` to import a module first.
        kwargs: Arguments of `gymnasium.make` that JSON can hold, such as a body as JSON.
    """

    id: str
    kwargs: dict[str, Any] = {}

    def __str__(self) -> str:
        """The id, with the arguments if there are any."""
        arguments = ", ".join(f"{name}={value}" for name, value in self.kwargs.items())
        return f"{self.id} ({arguments})" if arguments else self.id

    def having(self, more: Mapping[str, Any]) -> EnvRef:
        """Return the same env with additional or replaced arguments."""
        return EnvRef(self.id, {**self.kwargs, **more})

    def make(self, **more: Any) -> gym.Env[Any, Any]:
        """Make the env.

        Args:
            **more: Arguments for this instance only, such as `render_mode`.

        Raises:
            UnknownName: If no env has this id.
            StudyError: If it does not take these arguments.
        """
        try:
            return gym.make(self.id, **{**self.kwargs, **more})
        except (gym.error.UnregisteredEnv, ModuleNotFoundError) as error:
            known = [name for name in gym.registry if name.startswith("shapechanger/")]
            raise UnknownName("environment", self.id, known) from error
        except TypeError as error:
            # Gymnasium adds this where the constructor of the env refuses an argument.
            reason, refused, _ = str(error).partition(" was raised from the environment creator")
            if not refused:
                raise
            raise StudyError(f"{self.id} cannot be made with these options: {reason}.") from error


class BodyDraw(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Bodies of a family, as the argument `bodies` of an env that stands for many.

    Attributes:
        split: Part of the family: "train", "interpolation", "extrapolation" or "composition".
        count: How many bodies.
        seed: Seed of the draws.
    """

    split: str = "train"
    count: int = 32
    seed: int = 0


def each_body(env: EnvRef) -> list[EnvRef]:
    """Return one env for each of the bodies that an env stands for.

    Args:
        env: An env; its argument `bodies` is a list of bodies as JSON, or a `BodyDraw` as a
            mapping. Without one it stands for itself.

    Raises:
        StudyError: If `bodies` is neither, or the env's body belongs to no family.
        UnknownName: If there is no such split.
        MorphologyError: If the family cannot be drawn from.
    """
    if "bodies" not in env.kwargs:
        return [env]
    one = EnvRef(env.id, {k: v for k, v in env.kwargs.items() if k != "bodies"})
    given = env.kwargs["bodies"]
    if isinstance(given, Mapping):
        try:
            draw = msgspec.convert(given, BodyDraw)
        except msgspec.ValidationError as error:
            raise StudyError(f"The bodies of {env.id} are wrong: {error}.") from None
        made = one.make()
        try:
            if not isinstance(made.unwrapped, HasBodyFamily):
                raise StudyError(f"The body of {env.id} belongs to no family to draw from.")
            given = made.unwrapped.drawn_bodies(draw.count, draw.seed, draw.split)
        finally:
            made.close()
    if not given:
        raise StudyError(f"{env.id} needs at least one body.")
    return [one.having({"body": body}) for body in given]


class TaskDemonstrator(Protocol):
    """An expert for the task of an env."""

    def begin(self) -> None:
        """Start an episode."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the intended action, which is learned, and the executed one."""
        ...


@runtime_checkable
class HasDemonstrator(Protocol):
    """An env with an expert for its task."""

    def demonstrator(self, seed: int) -> TaskDemonstrator:
        """Return the expert; `seed` determines its mistakes."""
        ...


@runtime_checkable
class CanBeTaught(Protocol):
    """An env whose demonstrations can come from a policy of another env with richer observations.

    Attributes:
        teacher_env: Id of that env.
    """

    teacher_env: str

    def taught_by(self, act: Callable[[NDArray[Any]], NDArray[Any]], seed: int) -> TaskDemonstrator:
        """Return a demonstrator of this env that acts as a teacher does.

        Args:
            act: The teacher: maps observations of the teacher's env, (n, k), to actions, (n, m).
            seed: Seed of the mistakes that it makes on purpose.
        """
        ...


@runtime_checkable
class HasHeldOutStarts(Protocol):
    """An env whose surroundings can be drawn from a set that training never uses."""

    def hold_out(self) -> None:
        """Draw from the held-out set from now on."""
        ...


@runtime_checkable
class HasBodyFamily(Protocol):
    """An env whose body is one of a continuous family."""

    @property
    def family_name(self) -> str:
        """Name of the family, such as "ant"."""
        ...

    def arguments_towards(self, target: Any, alpha: float) -> dict[str, Any]:
        """Return arguments that make a body on the way to the body of another env.

        Args:
            target: An env of the same family.
            alpha: The part of the way, 0 to 1.
        """
        ...

    def arguments_between(self, target: Any) -> dict[str, Any]:
        """Return arguments that draw a body between this one and another env's at each reset.

        Args:
            target: An env of the same family and spaces.
        """
        ...

    def drawn_bodies(self, count: int, seed: int, split: Any) -> list[str]:
        """Return bodies of the family as JSON.

        Args:
            count: How many.
            seed: Seed of the draws.
            split: Part of the family to draw from.
        """
        ...


class LimbNumbers(Protocol):
    """One joint of a body, and what it moves up to the next."""

    @property
    def joint(self) -> str:
        """Name of its hinge or slide."""
        ...

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of its body and of those fixed to it."""
        ...

    @property
    def actuator(self) -> str:
        """Name of the actuator that moves the joint; empty if no actuator does."""
        ...

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers that describe it."""
        ...


class KinematicTree(Protocol):
    """The trunk and the limbs of a body."""

    @property
    def trunk(self) -> tuple[str, ...]:
        """Names of the trunk's body and of those fixed to it."""
        ...

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers that describe the trunk."""
        ...

    @property
    def limbs(self) -> Sequence[LimbNumbers]:
        """Its limbs."""
        ...

    @property
    def trunk_numbers(self) -> tuple[str, ...]:
        """Names of the numbers of the trunk."""
        ...

    @property
    def limb_numbers(self) -> tuple[str, ...]:
        """Names of the numbers of each limb."""
        ...


@runtime_checkable
class HasTree(Protocol):
    """An env that describes the kinematic tree of its body."""

    @property
    def tree(self) -> KinematicTree:
        """The trunk and the limbs of the present body."""
        ...


@runtime_checkable
class SourceAdaptation(Protocol):
    """A target env that can adapt its source env to itself."""

    def randomised_source(self) -> dict[str, Any]:
        """Return source arguments that randomise its body over the plausible ones."""
        ...

    def identified_source(self, seed: int) -> dict[str, Any]:
        """Return source arguments identified from motions of this env.

        Args:
            seed: Seed of the motions.
        """
        ...


@runtime_checkable
class _CertifiesShift(Protocol):
    def certify_shift(self, source: Any, target: Any) -> object: ...


@dataclass(frozen=True, slots=True)
class EnvTraits:
    """Properties of an env, read once per study.

    Attributes:
        observation_layout: Meaning of an observation.
        action_layout: Meaning of an action.
        observation_space: Its space.
        action_space: Its space.
        exclusive: Whether only one run at a time may use the env, as a robot.
        individual: Name of the argument that selects one of several individuals; may be empty.
        has_demonstrator: Whether it has an expert for its task.
        adapts_source: Whether it can adapt its source.
        family: Name of the continuous family that its body belongs to; may be empty.
        measures: What a policy is measured by, the default first.
        identified: The version of its robot and of the user's own files.
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
    identified: IdentifiedEnv

    def same_layouts(self, other: EnvTraits) -> bool:
        """Return whether observations and actions mean the same in another env."""
        return (self.observation_layout, self.action_layout) == (
            other.observation_layout,
            other.action_layout,
        )


def env_traits(env: gym.Env[Any, Any], env_id: str = "") -> EnvTraits:
    """Read the traits of an env.

    Args:
        env: The env.
        env_id: Its id, which may name a module.

    Raises:
        LayoutError: If it publishes no layouts.
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
        has_demonstrator=isinstance(inner, HasDemonstrator),
        adapts_source=isinstance(inner, SourceAdaptation),
        family=inner.family_name if isinstance(inner, HasBodyFamily) else "",
        measures=measures_of(env),
        identified=identify_env(env, env_id),
    )


def is_single_instance(env: gym.Env[Any, Any]) -> bool:
    """Return whether only one instance can exist, as of a robot: `side_by_side = False`."""
    return not getattr(env.unwrapped, "side_by_side", True)


def measures_of(env: gym.Env[Any, Any]) -> tuple[Measure, ...]:
    """Return the measures of an env, the default first; the return is always one of them."""
    declared: tuple[Measure, ...] = getattr(env.unwrapped, "measures", ())
    return declared if RETURN in declared else (*declared, RETURN)


def is_reward_term(name: str) -> bool:
    """Return whether a number of a step's `info` is a term of the reward.

    Args:
        name: Its name: `reward_...`, or `..._penalty` as of negative costs in Gymnasium.
    """
    return name.startswith("reward_") or name.endswith("_penalty")


def layouts_of(env: gym.Env[Any, Any]) -> tuple[Layout, Layout]:
    """Return the observation and the action layout of an env, or of its outermost wrapper with one.

    Raises:
        LayoutError: If it publishes none.
    """
    found = [
        env.get_wrapper_attr(name) if env.has_wrapper_attr(name) else None
        for name in ("observation_layout", "action_layout")
    ]
    if not all(isinstance(layout, Layout) for layout in found):
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise LayoutError(
            f"{name} publishes no observation_layout and action_layout, so the meaning of its "
            "numbers is unknown: add them to the env, as `shapechanger.Layout`s."
        )
    observation, action = cast("list[Layout]", found)
    return observation, action


def certify_shift(source: gym.Env[Any, Any], target: gym.Env[Any, Any]) -> str:
    """Return the certificate of the change between two envs; empty if the source issues none.

    Args:
        source: The env before the change.
        target: The env after it.

    Raises:
        EmptyShift: If nothing changes.
        StudyError: If an env fails in the rollout that the certificate compares.
    """
    inner = source.unwrapped
    if not isinstance(inner, _CertifiesShift):
        return ""
    try:
        return str(inner.certify_shift(source, target))
    except ShapechangerError:
        raise
    except (TypeError, ValueError, ArithmeticError) as error:
        names = " or ".join(env.spec.id if env.spec else str(env) for env in (source, target))
        raise StudyError(
            f"{names} fails in a short rollout ({error}): check the arguments of the env."
        ) from error
