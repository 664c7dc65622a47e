"""Cloned policies without PyTorch: settings, preparation of inputs, and actions."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import DemosError, PolicyError
from shapechanger.policy import CloneNetwork, Framing, Network, Policy, PolicyCard, load_policy

if TYPE_CHECKING:
    from shapechanger.demos.episodes import EpisodeHeader

# A mean in single precision may be below a half by a rounding error; it is still rounded up.
HALF: Final = 0.5 + 1e-4
_ROUNDING: Final = 1e-4  # Tolerance of actions in single precision.


def _require(settings: Any, names: str, limits: str, fits: Callable[[float], bool]) -> None:
    """Raise an error if a setting in `names` is out of limits or an empty tuple."""
    for name in names.split():
        value: Any = getattr(settings, name)
        values: Any = value if hasattr(value, "__len__") else (value,)
        if not values or not all(map(fits, values)):
            raise DemosError(f"{name} must be {limits}, got {value}.")


class Augmentation(msgspec.Struct, frozen=True, kw_only=True):
    """Random changes of each image, drawn again each time that it is used for training.

    Attributes:
        mirror: Share of images that are mirrored, with their actions.
        shift: Maximum shift to each side, and up and down, pixels.
        gain: Maximum brightness factor, >= 1; its inverse is the minimum.
        colour: Maximum further factor of a single colour, >= 1; its inverse is the minimum.
        offset: Maximum offset of all pixels in either direction, as a share of full brightness.
        noise: Maximum standard deviation of the noise, as a share of full brightness.
        noisy: Share of images with noise.
        blurred: Share of images that are blurred over 3 x 3 pixels.
    """

    mirror: float = 0.5
    shift: int = 2
    gain: float = 1.8
    colour: float = 1.2
    offset: float = 0.08
    noise: float = 0.04
    noisy: float = 0.3
    blurred: float = 0.2

    def __post_init__(self) -> None:
        _require(self, "mirror noisy blurred", "in [0, 1]", lambda x: 0.0 <= x <= 1.0)
        _require(self, "shift offset noise", "at least 0", lambda x: x >= 0.0)
        _require(self, "gain colour", "at least 1", lambda x: x >= 1.0)


class CloneSettings(msgspec.Struct, frozen=True, kw_only=True):
    """Hyperparameters of behaviour cloning.

    Attributes:
        framing: Crop and resolution; training that starts from a policy uses that policy's framing.
        channels: Filters of each convolution; each one halves rows and columns.
        features: Number of features between image and actions.
        batch: Examples per step.
        passes: Number of passes over the data, within `fewest_steps` and `most_steps`.
        fewest_steps: Minimum number of steps.
        most_steps: Maximum number of steps.
        learning_rate: Initial learning rate; falls to 0 along half a cosine.
        further_rate: Initial learning rate when another policy is trained further.
        warm_up: Steps in which the rate rises from 0.
        weight_decay: Weight decay of AdamW.
        held_out: Share of the steps, in [0, 1), in one stretch, that is used for early stopping
            instead of training.
        checks: Number of validations during training.
        rehearsal: Share of each batch that comes from the rehearsal data, if there are any.
        augmentation: Random changes of the images.
        eyes: Input of the first layer: "colours", or "edges": strength of the edges of each
            direction in each cell, which does not depend on light and colour.
        nerves: Widths of the layers for the state.
        members: Number of averaged networks; each uses a different part of the data for early
            stopping, so that together they learn from all data.
        dropout: Share of the features that are dropped in each step.
        smoothing: Label smoothing of classes.
        averaging: Decay of the exponential moving average of the weights; 0 for no average.
    """

    framing: Framing = Framing()
    # Few filters in the first layer, which is by far the most expensive one: 16 and 32 in the first
    # two took 1.8 times as long per step, and drove no better after the same number of steps.
    channels: tuple[int, ...] = (8, 24, 48, 64)
    features: int = 96
    batch: int = 64
    passes: float = 12.0
    fewest_steps: int = 500
    most_steps: int = 1400
    learning_rate: float = 2e-3
    further_rate: float = 1e-3
    warm_up: int = 50
    weight_decay: float = 1e-3
    held_out: float = 0.1
    checks: int = 10
    rehearsal: float = 0.25
    augmentation: Augmentation = Augmentation()
    eyes: Literal["colours", "edges"] = "colours"
    nerves: tuple[int, ...] = (64, 64)
    members: int = 1
    dropout: float = 0.0
    smoothing: float = 0.0
    averaging: float = 0.0

    def __post_init__(self) -> None:
        counts = "channels features batch fewest_steps checks nerves members"
        shares = "held_out rehearsal dropout smoothing averaging"
        _require(self, counts, "at least 1", lambda x: x >= 1)
        _require(self, "most_steps", "at least fewest_steps", lambda x: x >= self.fewest_steps)
        _require(self, "passes learning_rate further_rate", "positive", lambda x: x > 0.0)
        _require(self, "warm_up weight_decay", "at least 0", lambda x: x >= 0.0)
        _require(self, shares, "in [0, 1)", lambda x: 0.0 <= x < 1.0)

    def steps(self, pictures: int) -> int:
        """Return the number of training steps for this many examples."""
        wanted = round(self.passes * pictures / self.batch)
        return min(max(wanted, self.fewest_steps), self.most_steps)


# Chosen on the first 430 frames of a real drive by the accuracy on five later stretches;
# benchmarks/cloning_real.py lists the alternatives.
DEMOS: Final = CloneSettings(
    framing=Framing(height=48, width=64, top=0.0),
    channels=(24, 48),
    features=64,
    batch=32,
    passes=25.0,
    fewest_steps=300,
    most_steps=3000,
    learning_rate=2e-3,
    weight_decay=0.1,
    held_out=0.15,
    checks=12,
    augmentation=Augmentation(shift=3),
    eyes="edges",
    members=4,
    dropout=0.5,
    smoothing=0.1,
    averaging=0.98,
)
"""Settings for few demonstrations."""

# Number of steps from which one network on colours and finer images is used: 2.5 minutes at 20 Hz.
_MANY: Final = 3000


def settings_for(steps: int) -> CloneSettings:
    """Return the settings for this many demonstrated steps.

    With many steps, no steps are held out, and the last network is kept: early stopping can choose
    a network that drives badly, see docs/cloning.md.
    """
    return DEMOS if steps < _MANY else CloneSettings(held_out=0.0)


def prepare(pictures: NDArray[np.uint8], framing: Framing) -> NDArray[np.uint8]:
    """Crop and reduce uint8 images, (n, H, W, 3), to the shape (n, height, width, 3) of a framing.

    Each pixel is the mean of its area, rounded half up. Images that already have the target size
    are returned unchanged, and arrays of another type or shape are refused.
    """
    shape = pictures.shape
    if len(shape) != 4 or shape[3] != 3 or 0 in shape[1:] or pictures.dtype != np.uint8:
        raise DemosError(
            "Images must be uint8 with shape (n, height, width, 3), got "
            f"{pictures.dtype} with shape {shape}."
        )
    if shape[1:] == framing.shape:
        return pictures
    _, height, width, _ = shape
    first = first_row(height, framing)
    rows = area_shares(height - first, framing.height)
    columns = area_shares(width, framing.width)
    small = np.empty((len(pictures), *framing.shape), np.uint8)
    for i, picture in enumerate(pictures[:, first:]):  # One at a time: they may be large.
        low = (rows @ picture.reshape(len(picture), -1).astype(np.float32)).reshape(-1, width, 3)
        narrow = columns @ low.swapaxes(0, 1).reshape(width, -1)
        small[i] = np.floor(narrow.reshape(-1, len(low), 3).swapaxes(0, 1) + HALF)
    return small


def first_row(height: int, framing: Framing) -> int:
    """Return the index of the first row after the crop, which keeps at least one row."""
    return min(round(height * framing.top), height - 1)


@cache
def area_shares(before: int, after: int) -> NDArray[np.float32]:
    """Return the weight of each old pixel in each new one along one axis, shape (after, before)."""
    edges = np.linspace(0.0, before, after + 1)
    old = np.arange(before)
    overlap = np.minimum(edges[1:, None], old + 1) - np.maximum(edges[:-1, None], old)
    shares = np.clip(overlap, 0.0, None)
    return (shares / shares.sum(axis=1, keepdims=True)).astype(np.float32)


@dataclass
class ShrunkFrames:
    """Convert frames to a policy's view while they are read, and record their digests.

    Attributes:
        framing: Crop and resolution.
        view: Converts a frame to the view of the policy's camera; None to leave it as it is.
        size: Rows and columns of the last frame before it was reduced; None before the first frame.
        seen: Digests of the frames.
    """

    framing: Framing
    view: Callable[[NDArray[np.uint8], EpisodeHeader], NDArray[np.uint8]] | None = None
    size: tuple[int, int] | None = None
    seen: list[bytes] = field(default_factory=list[bytes])

    def __call__(self, picture: NDArray[np.uint8], header: EpisodeHeader) -> NDArray[np.uint8]:
        """Return the policy's view of a frame of an episode."""
        if self.view is not None:
            picture = self.view(picture, header)
        self.size = picture.shape[0], picture.shape[1]
        self.seen.append(hashlib.sha256(picture.tobytes()).digest())
        return prepare(picture[None], self.framing)[0]

    def digest(self, actions: NDArray[np.float32]) -> str:
        """Return a digest of the frames that were read and of these actions."""
        return hashlib.sha256(b"".join(self.seen) + actions.tobytes()).hexdigest()


class Clone(Policy):
    """A cloned policy of images, states or both.

    Its network, `run`, maps prepared images, `picture`, and states, `state`, to outputs.
    """

    def __init__(self, card: PolicyCard, run: Network) -> None:
        self.card, self._run = card, run

    @property
    def net(self) -> CloneNetwork:
        """Architecture of the network."""
        return self.card.network

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return class probabilities, shape (n, classes), or scaled actions, (n, m), -1 to 1."""
        given = zip(("picture", "state"), prepared(self.card, pictures, states), strict=True)
        return self._run({name: part for name, part in given if part is not None})

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the action, shape (m,), for one image, (H, W, 3), and state, (k,)."""
        single: Any = (None if part is None else part[np.newaxis] for part in (picture, state))
        return self.predict_many(*single)[0]

    def predict_many(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return an action for each image and state.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), raw or prepared; None for a policy
                without images.
            states: Shape (n, k), NaN for unknown values; None for a policy without a state.

        Returns:
            Actions, shape (n, m), in the card's action layout; without one, steering (-1 is left)
            and throttle (1 is forward).

        Raises:
            DemosError: If an input is missing or has another shape.
        """
        net, outputs = self.net, self.outputs(pictures, states)
        if net.classes:
            return np.asarray(net.classes, np.float32)[outputs.argmax(axis=1)]
        if not net.low:
            return outputs
        low, high = np.asarray(net.low, np.float32), np.asarray(net.high, np.float32)
        return (low + 0.5 * (outputs + 1.0) * (high - low)).astype(np.float32)

    def act(self, observations: Any) -> NDArray[np.float32]:
        """Return an action for each observation of an env, shape (n, m), as `predict_many` does."""
        if isinstance(observations, Mapping):
            named = cast("Mapping[str, NDArray[Any]]", observations)
            return self.predict_many(named.get("image"), named.get("state"))
        values: NDArray[Any] = np.asarray(observations)
        return self.predict_many(*((None, values) if self.net.eyes == "none" else (values,)))


def load_clone(path: Path) -> Clone:
    """Load a clone from a PyTorch or ONNX file.

    Raises:
        PolicyError: If the file is missing or damaged, or not a clone.
        MissingExtra: If a package that the file needs is not installed.
    """
    policy = load_policy(path)
    if not isinstance(policy, Clone):
        raise PolicyError(f"{path} learned by {policy.card.learner}, and a clone is needed here.")
    return policy


def prepared(
    card: PolicyCard, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None
) -> tuple[NDArray[np.uint8] | None, NDArray[np.float32] | None]:
    """Return the inputs for the network of a clone; None for an input that it does not have.

    Raises:
        DemosError: If an input is missing or has another shape.
    """
    net, layout = card.network, card.observation
    seen = None
    if net.eyes != "none":
        if pictures is None:
            raise DemosError("This policy needs an image, and none was given.")
        seen = prepare(pictures, net.framing)
    if layout is None:
        return seen, None
    if states is None or states.ndim != 2 or states.shape[1] != layout.size:
        names, got = ", ".join(layout.names), "none" if states is None else states.shape
        raise DemosError(
            f"This policy needs the state {names} with shape (n, {layout.size}), got {got}."
        )
    known = np.array(states, np.float32)
    for name in net.unseen:
        known[:, layout.slices[name]] = np.nan
    return seen, known


def targets(net: CloneNetwork, actions: NDArray[np.float32]) -> NDArray[Any]:
    """Return the target outputs of a network for actions of shape (n, m).

    They are class indices, shape (n,), -1 for an unknown action, or actions scaled to [-1, 1],
    shape (n, m). If the network states a range, actions outside it are clipped; otherwise actions
    outside [-1, 1] are refused.
    """
    if net.classes:
        return class_numbers(actions, net.classes)
    if not net.low:
        wrong = np.flatnonzero(~(np.abs(actions) <= 1.0 + _ROUNDING).all(axis=1))
        if len(wrong):
            found = f"action {wrong[0]} is {actions[wrong[0]].tolist()}"
            raise DemosError(f"Steering and throttle must be in [-1, 1], but {found}.")
        return actions.astype(np.float32)
    low, high = np.asarray(net.low, np.float32), np.asarray(net.high, np.float32)
    return (2.0 * (actions - low) / (high - low) - 1.0).astype(np.float32).clip(-1.0, 1.0)


def class_numbers(
    actions: NDArray[np.floating], classes: tuple[tuple[float, ...], ...]
) -> NDArray[np.int64]:
    """Return the class index of each action of shape (n, m); -1 for an unknown action."""
    apart = np.abs(actions[:, None, :] - np.asarray(classes, np.float32)).max(axis=2)
    return np.where(apart.min(axis=1) < _ROUNDING, apart.argmin(axis=1), -1).astype(np.int64)
