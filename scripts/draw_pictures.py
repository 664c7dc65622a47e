"""Draw the pictures of the README: `python scripts/draw_pictures.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shapechanger.envs.finger.oracle import FingerOracle
from shapechanger.transfer.env_ref import EnvRef

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
ANTS: Final = ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt")
VEHICLES: Final = ("Car", "Tank", "Truck", "Boat")


_SIZE: Final = 300, 240
_DRIVEN_S: Final = 3.0


def main() -> None:
    """Draw four ants, four vehicles with what their cameras see, and a finger on its way."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    iio.imwrite(PICTURES / "ants.jpg", _row(ANTS), quality=85)
    seen = np.concatenate([_seen(name) for name in VEHICLES], axis=1)
    iio.imwrite(PICTURES / "vehicles.jpg", np.concatenate([_row(VEHICLES), seen]), quality=85)
    iio.imwrite(PICTURES / "finger.jpg", _finger(), quality=85)


def _finger() -> NDArray[np.uint8]:
    """A finger on a circle, four times."""
    made = EnvRef("shapechanger/FingerTrack-v1", {"path": {"kind": "circle", "radius": 0.018}})
    wide, high = _SIZE
    env = cast("Any", made.make(render_mode="rgb_array", width=wide, height=high))
    act = FingerOracle(env.unwrapped.observation_layout)
    observation, _ = env.reset(seed=1)
    frames: list[NDArray[np.uint8]] = []
    for step in range(100):
        if step % 25 == 0:
            frames.append(env.render())
        observation, *_ = env.step(act(observation))
    env.close()
    return np.concatenate(frames, axis=1)


def _row(names: tuple[str, ...]) -> NDArray[np.uint8]:
    """Bodies side by side."""
    envs = [cast("Any", EnvRef(f"shapechanger/{name}-v1").make().unwrapped) for name in names]
    reach = 0.8 * max(env.reach for env in envs)
    row = np.concatenate([env.picture(*_SIZE, reach) for env in envs], axis=1)
    for env in envs:
        env.close()
    return row


def _seen(name: str) -> NDArray[np.uint8]:
    """What the camera of a vehicle sees after some seconds of its expert's driving."""
    env = cast("Any", EnvRef(f"shapechanger/{name}-v1").make())
    picture, _ = env.reset(seed=3)
    expert = env.unwrapped.demonstrator(seed=0)
    expert.begin()
    for _ in range(round(_DRIVEN_S * env.metadata["render_fps"])):
        picture, *_ = env.step(expert.act()[1])
    env.close()
    return np.asarray(Image.fromarray(picture).resize(_SIZE, Image.Resampling.NEAREST))


if __name__ == "__main__":
    main()
