"""Cards of cloned policies, stored with the weights, and policies that run without PyTorch."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.pictures import CloningError, Framing, PolicyError, prepare
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.identity import Identity
from shapechanger.layout import Layout
from shapechanger.onnx_file import read_network
from shapechanger.policy import CLONE_CARD

Head = Literal["regression", "class"]
"""Kind of output: continuous actions, or a choice among the actions that were demonstrated."""

STEERING: Final = ("steering", "throttle")
"""Names of the values of an action of a policy without an action layout."""

_MAX_MEMBERS: Final = 32  # Bounds the work that a forged card can cause.
_ROUNDING: Final = 1e-4  # Of actions in single precision.


class CloneCard(msgspec.Struct, frozen=True, kw_only=True):
    """Architecture and origin of a policy.

    Attributes:
        framing: Part of the image that the policy sees.
        channels: Filters of each convolution.
        features: Number of features between image and actions.
        seeds: Seeds of the trainings, last one last.
        steps: Step of the last training at which the policy was best.
        settings: Settings of the last training.
        data: Origin of the demonstrations, as given by the caller.
        command: Command that trained the policy.
        version: Version of Shapechanger.
        eyes: Input of the first layer: "colours" or "edges" of an image; "none" without images.
        nerves: Widths of the layers for the state; () without a state.
        members: Number of networks whose outputs are averaged.
        head: Kind of output.
        classes: Actions to choose from; () for continuous actions.
        class_names: Names of the classes.
        action_layout: Meaning of the values of an action; None for steering and throttle in [-1, 1]
            of any vehicle.
        state_layout: Meaning of the values of a state; None without a state.
        unseen: Names of state values that the policy ignores.
        low: Action for an output of -1; () for -1 each.
        high: Action for an output of 1; () for 1 each.
        identity: Version of the env whose demonstrator was cloned; {} for recordings.
        body: Kind of robot that an exported policy learned in, such as "car"; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.
    """

    framing: Framing
    channels: tuple[int, ...]
    features: int
    seeds: tuple[int, ...] = ()
    steps: int = 0
    settings: CloneSettings | None = None
    data: dict[str, Any] = {}
    command: str = ""
    version: str = msgspec.field(default_factory=lambda: version("shapechanger"))
    eyes: Literal["colours", "edges", "none"] = "colours"
    nerves: tuple[int, ...] = ()
    members: int = 1
    head: Head = "regression"
    classes: tuple[tuple[float, ...], ...] = ()
    class_names: tuple[str, ...] = ()
    action_layout: Layout | None = None
    state_layout: Layout | None = None
    unseen: tuple[str, ...] = ()
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    identity: dict[str, Identity] = {}
    body: str = ""
    control_hz: float | None = None

    def __post_init__(self) -> None:
        """Validate the architecture."""
        if not self.channels or min(self.features, *self.channels, *self.nerves) < 1:
            raise CloningError("channels, features and nerves must be positive.")
        if not 1 <= self.members <= _MAX_MEMBERS:
            raise CloningError(f"members must be from 1 to {_MAX_MEMBERS}, got {self.members}.")
        if bool(self.nerves) != (self.state_layout is not None):
            raise CloningError("nerves and state_layout must be given together.")
        if self.eyes == "none" and not self.nerves:
            raise CloningError("A policy needs images, a state, or both.")
        if (self.head == "class") != bool(self.classes):
            raise CloningError("The head class, and no other, needs classes.")
        if any(len(action) != self.action_size for action in self.classes):
            raise CloningError(f"Each class must have {self.action_size} values.")
        if len(self.class_names) != len(self.classes):
            raise CloningError("Each class must have a name.")
        if any(bounds and len(bounds) != self.action_size for bounds in (self.low, self.high)):
            raise CloningError(f"low and high must have {self.action_size} values.")

    @property
    def action_size(self) -> int:
        """Number of values in an action."""
        return 2 if self.action_layout is None else self.action_layout.size

    @property
    def state_size(self) -> int:
        """Number of values in a state; 0 without one."""
        return 0 if self.state_layout is None else self.state_layout.size

    @property
    def outputs(self) -> int:
        """Number of outputs of the network."""
        return len(self.classes) or self.action_size

    @property
    def inputs(self) -> dict[str, list[int]]:
        """Shapes of the inputs of the network, `picture` and `state`, without their first axis."""
        shapes: dict[str, list[int]] = {}
        if self.eyes != "none":
            shapes["picture"] = list(self.framing.shape)
        if self.state_size:
            shapes["state"] = [self.state_size]
        return shapes

    def targets(self, actions: NDArray[np.float32]) -> NDArray[Any]:
        """Return the target outputs of the network for actions of shape (n, m).

        Returns:
            Class indices, shape (n,), -1 for an unknown action; or actions scaled to [-1, 1], shape
            (n, m).

        Raises:
            CloningError: If an action is out of range, where the card states no other than [-1, 1].
        """
        if self.classes:
            return class_numbers(actions, self.classes)
        if not self.low:
            if (wrong := ~(np.abs(actions) <= 1.0 + _ROUNDING).all(axis=1)).any():
                first = int(wrong.argmax())
                raise CloningError(
                    f"Steering and throttle must be in [-1, 1], but action {first} is "
                    f"{actions[first].tolist()}."
                )
            return actions.astype(np.float32)
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        return (2.0 * (actions - low) / (high - low) - 1.0).astype(np.float32).clip(-1.0, 1.0)

    def actions(self, outputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions for outputs of the network, the inverse of `targets`.

        Args:
            outputs: Class probabilities, shape (n, classes), or actions in [-1, 1], shape (n, m).

        Returns:
            Actions, shape (n, m).
        """
        if self.classes:
            return np.asarray(self.classes, np.float32)[outputs.argmax(axis=1)]
        if not self.low:
            return outputs
        low, high = np.asarray(self.low, np.float32), np.asarray(self.high, np.float32)
        return (low + 0.5 * (outputs + 1.0) * (high - low)).astype(np.float32)

    def prepared(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None
    ) -> tuple[NDArray[np.uint8] | None, NDArray[np.float32] | None]:
        """Return images and states as the network takes them; None for an input it lacks.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), raw or prepared.
            states: Shape (n, k), NaN for unknown values.

        Raises:
            CloningError: If an input is missing or has another shape.
        """
        if self.eyes == "none":
            pictures = None
        elif pictures is None:
            raise CloningError("This policy needs an image, and none was given.")
        seen = None if pictures is None else prepare(pictures, self.framing)
        layout = self.state_layout
        if layout is None:
            return seen, None
        if states is None or states.ndim != 2 or states.shape[1] != layout.size:
            raise CloningError(
                f"This policy needs the state {', '.join(layout.names)} with shape "
                f"(n, {layout.size}), got {'none' if states is None else states.shape}."
            )
        known = np.array(states, np.float32)
        for name in self.unseen:
            known[:, layout.slices[name]] = np.nan
        return seen, known

    def require_layouts(self, actions: Layout, state: Layout | None = None) -> None:
        """Refuse a robot, an env or data whose layouts differ from the policy's.

        Args:
            actions: Layout of its actions.
            state: Layout of its state; None without a state.

        Raises:
            PolicyError: If the layouts differ.
        """
        mine = STEERING if self.action_layout is None else _words(self.action_layout)
        theirs = _words(actions)
        if self.action_layout is None:
            theirs = tuple(word.split(" ")[0] for word in theirs)
        if mine != theirs:
            raise PolicyError(
                f"The actions of the policy are {', '.join(mine)}, but those required here are "
                f"{', '.join(theirs)}."
            )
        if self.state_layout is None:
            return
        felt = () if state is None else _words(state)
        if _words(self.state_layout) != felt:
            raise PolicyError(
                f"The policy needs the state {', '.join(_words(self.state_layout))}, but it gets "
                f"{', '.join(felt) or 'none'}."
            )


class ActingClone(ABC):
    """A policy for images, states or both.

    Attributes:
        card: Its architecture and origin.
    """

    card: CloneCard

    @abstractmethod
    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return class probabilities, shape (n, classes); or actions in [-1, 1], shape (n, m).

        Args:
            pictures: As in `predict_many`.
            states: As in `predict_many`.

        Raises:
            CloningError: If an input is missing or has another shape.
        """

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the action for one image and state, as `predict_many` does for several.

        Args:
            picture: Red, green and blue, shape (H, W, 3).
            state: Shape (k,).

        Returns:
            Action, shape (m,). For a vehicle: steering (-1 is left) and throttle (1 is forward).
        """
        return self.predict_many(
            None if picture is None else picture[np.newaxis],
            None if state is None else state[np.newaxis],
        )[0]

    def predict_many(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return an action for each image and state.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), raw or prepared; None for a policy
                without images.
            states: Shape (n, k), NaN for unknown values; None for a policy without a state.

        Returns:
            Actions, shape (n, m).

        Raises:
            CloningError: If an input is missing or has another shape.
        """
        return self.card.actions(self.outputs(pictures, states))

    def act(self, observations: Any) -> NDArray[np.float32]:
        """Return an action for each observation of an env, shape (n, m).

        Args:
            observations: Images, shape (n, H, W, 3); states, shape (n, k), for a policy without
                images; a mapping with `image` and `state` for one with both.

        Raises:
            CloningError: If an input is missing or has another shape.
        """
        if isinstance(observations, Mapping):
            named = cast("Mapping[str, NDArray[Any]]", observations)
            return self.predict_many(named.get("image"), named.get("state"))
        values: NDArray[Any] = np.asarray(observations)
        return self.predict_many(*((None, values) if self.card.eyes == "none" else (values,)))


class OnnxClone(ActingClone):
    """A cloned policy from an ONNX file, which runs without PyTorch.

    Attributes:
        card: Card of the policy.

    Args:
        path: The file, read once: a later change of it changes nothing here.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        PolicyError: If the file is missing or is not such a policy.
    """

    def __init__(self, path: Path) -> None:
        self.card, self._run = read_network(
            path,
            CloneCard,
            lambda card: card.inputs | {"output": [card.outputs]},
            PolicyError,
            CLONE_CARD,
        )

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `ActingClone` describes them."""
        given = zip(("picture", "state"), self.card.prepared(pictures, states), strict=True)
        return self._run({name: part for name, part in given if part is not None})


def _words(layout: Layout) -> tuple[str, ...]:
    """Return the names with units, and the shapes of array features."""
    return tuple(f"{f}{f' x {f.shape}' if f.shape else ''}" for f in layout)


def class_numbers(
    actions: NDArray[np.floating], classes: tuple[tuple[float, ...], ...]
) -> NDArray[np.int64]:
    """Return the class index of each action, shape (n,); -1 for an unknown action.

    Args:
        actions: Shape (n, m).
        classes: The actions of the classes.
    """
    known = np.asarray(classes, np.float32)
    apart = np.abs(actions[:, None, :] - known).max(axis=2)
    return np.where(apart.min(axis=1) < _ROUNDING, apart.argmin(axis=1), -1).astype(np.int64)
