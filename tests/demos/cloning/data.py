"""Small demonstrations: of stripes, or of a door in a corridor."""

from __future__ import annotations

from typing import Any, Final

import msgspec
import numpy as np

from shapechanger.demos.cloning.clone import DEMOS, Augmentation, CloneSettings
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import Dataset
from shapechanger.layout import Feature, Layout
from shapechanger.policy import CloneNetwork, Framing, PolicyCard

_KEYS = ("forward", "backward", "right", "left")
KEYS: Final = Layout(tuple(Feature(name, "1", 0.0, 1.0) for name in _KEYS))
STEERS: Final = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
STATE: Final = Layout(
    (Feature("distance", "m"), Feature("speed", "m/s"), Feature("steering/applied", "1", -1.0, 1.0))
)

QUICK: Final = msgspec.structs.replace(
    DEMOS,
    framing=Framing(height=16, width=24, top=0.0),
    channels=(16,),
    features=32,
    members=2,
    fewest_steps=150,
    most_steps=150,
    checks=3,
    nerves=(16,),
    dropout=0.1,
    averaging=0.9,
    learning_rate=5e-3,
    weight_decay=1e-3,
    augmentation=Augmentation(shift=1, noisy=0.0),
)


def clone_card(
    action: Layout | None = None,
    observation: Layout | None = None,
    data: dict[str, Any] | None = None,
    **net: Any,
) -> PolicyCard:
    """Return the card of a small clone; `net` changes fields of its network."""
    small = {"framing": Framing(height=24, width=32), "channels": (4, 6), "features": 8}
    clone = CloneNetwork(**{**small, **net})
    return PolicyCard(
        learner="cloning", action=action, observation=observation, clone=clone, data=data or {}
    )


def stripes(n: int, seed: int, layout: Layout = KEYS) -> Dataset:
    """Return dark noise with a stripe on the left, in the middle or on the right.

    The side, -1, 0 or 1, sets the steering or the key that is held. The first value of the state is
    twice the side, and the last equals the first value of the action.
    """
    rng = np.random.default_rng(seed)
    side = rng.integers(-1, 2, n)
    pictures = rng.integers(0, 60, (n, 33, 50, 3), np.uint8)
    for picture, where in zip(pictures, side, strict=True):
        middle = round(50 * (0.5 + 0.3 * where))
        picture[:, middle - 4 : middle + 4] += 150
    if layout == KEYS:
        actions = np.zeros((n, 4), np.float32)
        actions[np.arange(n), np.array([3, 0, 2])[side + 1]] = 1.0
    else:
        steering = np.clip(0.8 * side + rng.normal(0.0, 0.03, n), -1.0, 1.0)
        actions = np.stack([steering, np.full(n, 0.5)], axis=1).astype(np.float32)
    states = np.stack([2.0 * side, rng.normal(0.0, 1.0, n), actions[:, 0]], axis=1)
    return Dataset(
        pictures=pictures,
        states=states.astype(np.float32),
        actions=actions,
        episodes=(n,),
        times_s=np.arange(n) / 20.0,
        files=tuple(f"stripes/{i}" for i in range(n)),
        action_layout=layout,
        state_layout=STATE,
        control_hz=20.0,
    )


SIZE: Final = (24, 40)
"""Rows and columns of images of the corridor."""

SMALL: Final = CloneSettings(
    framing=Framing(height=24, width=40, top=0.2),
    channels=(8, 16, 24),
    features=32,
    batch=32,
    fewest_steps=150,
    most_steps=150,
    warm_up=10,
    checks=5,
)
"""Settings that learn the corridor in seconds."""


def corridor(n: int, seed: int, gain: float = 1.0) -> Dataset:
    """Return images of a door ahead in any light, with the actions of a driver towards it.

    Vehicles differ in their steering gain.
    """
    rng = np.random.default_rng(seed)
    place = rng.uniform(-1.0, 1.0, n)
    door = np.abs(np.linspace(-1.0, 1.0, SIZE[1]) - place[:, None]) < 0.2
    light = rng.uniform(0.5, 1.0, (n, 1)) * np.where(door, 200.0, 60.0)
    pictures = light[:, None, :, None] + rng.normal(0.0, 4.0, (n, *SIZE, 3))
    steering = np.clip(gain * place, -1.0, 1.0)
    actions = np.stack((steering, 0.8 - 0.6 * np.abs(steering)), axis=1).astype(np.float32)
    seen = pictures.clip(0, 255).astype(np.uint8)
    return Dataset(seen, None, actions, (n,), np.arange(n) / 20.0, (), STEERS, None, 20.0)


def error(policy: CameraPolicy, test: Dataset) -> float:
    return float(np.abs(policy.predict_many(test.pictures) - test.actions).mean())
