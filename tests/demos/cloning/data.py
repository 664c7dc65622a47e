"""Small demonstrations: of stripes, or of a rendered corridor."""

from __future__ import annotations

from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import DEMOS, Augmentation, CloneSettings
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.dataset import Dataset
from shapechanger.layout import Feature, Layout
from shapechanger.policy import CloneNetwork, Framing, PolicyCard

KEYS: Final = Layout(
    tuple(Feature(name, "1", 0.0, 1.0) for name in ("forward", "backward", "right", "left"))
)
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
    """Return the card of a small clone, with other values of its network."""
    small = {"framing": Framing(height=24, width=32), "channels": (4, 6), "features": 8}
    clone = CloneNetwork(**{**small, **net})
    return PolicyCard(
        learner="cloning", action=action, observation=observation, clone=clone, data=data or {}
    )


def stripes(n: int, seed: int, layout: Layout = KEYS, size: tuple[int, int] = (33, 50)) -> Dataset:
    """Return dark noise with a stripe on the left, in the middle or on the right.

    The side sets the steering. The first state feature holds it too; the last equals the action.
    """
    rng = np.random.default_rng(seed)
    side = rng.integers(-1, 2, n)
    pictures = rng.integers(0, 60, (n, *size, 3), np.uint8)
    for picture, where in zip(pictures, side, strict=True):
        middle = round(size[1] * (0.5 + 0.3 * where))
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

# A camera a few centimetres above the floor with a field of view of 90 degrees across.
_EYE = 0.1
_WIDTH, _HEIGHT = 2.0, 2.5
_SLOW_BELOW = 4.0  # m to the wall at the end.


def corridor(n: int, seed: int, gain: float = 1.0) -> Dataset:
    """Return images of n poses in n corridors, with the actions of a driver.

    Args:
        n: Number of images.
        seed: Seed of poses, colours and noise.
        gain: Steering gain; another vehicle needs more, or less.
    """
    rng = np.random.default_rng(seed)
    aside = rng.uniform(-0.7, 0.7, n)  # m to the left of the middle.
    turned = rng.uniform(-0.5, 0.5, n)  # rad to the left of the corridor.
    ahead = rng.uniform(1.5, 12.0, n)  # m to the end.
    pictures = np.empty((n, *SIZE, 3), np.uint8)
    for i in range(n):
        picture = _look(aside[i], turned[i], ahead[i], rng)
        seen = rng.uniform(0.3, 0.6) * picture + rng.normal(0.0, 4.0, picture.shape)
        pictures[i] = np.clip(seen, 0, 255)
    # Right of the middle and looking right needs left, which is negative.
    steering = np.clip(gain * (1.2 * turned + 0.8 * aside), -1.0, 1.0)
    throttle = np.where(ahead < _SLOW_BELOW, 0.2, 0.8) - 0.3 * np.abs(steering)
    actions = np.stack((steering, throttle), axis=1).astype(np.float32)
    return Dataset(pictures, None, actions, (n,), np.arange(n) / 20.0, (), STEERS, None, 20.0)


def error(policy: CameraPolicy, test: Dataset) -> float:
    """Return the mean absolute error of the actions on test images."""
    return float(np.abs(policy.predict_many(test.pictures) - test.actions).mean())


def _look(
    aside: float, turned: float, ahead: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Render one image of a straight corridor by casting rays, at full light."""
    height, width = SIZE
    left = 1.0 - 2.0 * (np.arange(width) + 0.5) / width
    up = (1.0 - 2.0 * (np.arange(height) + 0.5) / height) * height / width + 0.1
    x = np.cos(turned) - left * np.sin(turned)
    y = np.sin(turned) + left * np.cos(turned)
    # Rays parallel to a plane meet it far away.
    to_end = np.where(x > 1e-6, ahead / np.maximum(x, 1e-6), 1e6)
    to_side = (np.sign(y) * _WIDTH / 2.0 - aside) / np.where(np.abs(y) < 1e-6, 1e-6, y)
    to_wall = np.minimum(to_end, np.abs(to_side))
    far = np.where(up > 0.0, _HEIGHT - _EYE, _EYE) / np.maximum(np.abs(up), 1e-6)
    along = x * to_wall
    flat = far[:, None] < to_wall[None, :]
    high = _EYE + up[:, None] * to_wall[None, :]

    wall, floor, door = (rng.uniform(80, 255, 3) for _ in range(3))
    pitch, phase = rng.uniform(2.0, 5.0), rng.uniform(0.0, 5.0)
    is_door = (np.mod(along + phase, pitch) < 0.9) & (to_wall < to_end)
    upright = np.where(is_door[None, :, None] & (high < 2.0)[:, :, None], door, wall)
    upright = np.where((high < 0.1)[:, :, None], 0.4 * wall, upright)  # The skirting board.
    shade = np.where(to_wall < to_end, 1.0, 0.6)
    ground = np.where(up > 0.0, 1.1, 0.7)[:, None, None] * floor
    return np.where(flat[:, :, None], ground, upright * shade[None, :, None])
