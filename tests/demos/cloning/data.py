"""Small demonstrations in which a bright stripe or a state feature determines the action."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from shapechanger.demos.cloning.pictures import Framing
from shapechanger.demos.cloning.settings import DEMOS, Augmentation
from shapechanger.demos.dataset import Dataset
from shapechanger.layout import Feature, Layout

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
