"""Draw the pictures of README and docs: `python scripts/draw_pictures.py`.

`--only vehicles` draws one of them, and `--only finger-film` films reach and follow.
`--sheets results/sheets` draws contact sheets instead, one of each world: a row for each vehicle
and course, with the camera's picture, the same through each lens, and two views from outside. The
last course of each vehicle is held out and has a random look.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any, Final, cast

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shapechanger.envs.finger.oracle import FingerOracle
from shapechanger.envs.finger.policies import POLICIES
from shapechanger.transfer.env_ref import EnvRef
from shapechanger.transfer.learners.policy_file import load_policy
from shapechanger.worlds.course import FLOODED, HELD_OUT, HOME
from shapechanger.worlds.lens import LENSES
from shapechanger.worlds.look import LOOKS, Look
from shapechanger.worlds.simulation import MujocoWorld

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
ANTS: Final = ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt")
VEHICLES: Final = ("Car", "Tank", "Truck", "Boat")


_SIZE: Final = 300, 240
_DRIVEN_S: Final = 3.0


def main() -> None:
    """Draw four ants, four vehicles with what their cameras see, and a finger on its way."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--only", choices=("ants", "vehicles", "finger", "finger-film"))
    parser.add_argument("--sheets", type=Path, help="folder for contact sheets of the worlds")
    asked = parser.parse_args()
    if asked.sheets is not None:
        asked.sheets.mkdir(parents=True, exist_ok=True)
        for world in LOOKS:
            iio.imwrite(asked.sheets / f"{world}.png", _sheet(world))
        return
    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, draw in (("ants", _ants), ("vehicles", _vehicles), ("finger", _finger)):
        if asked.only in (None, name):
            iio.imwrite(PICTURES / f"{name}.jpg", draw(), quality=85)
    if asked.only in (None, "finger-film"):
        _film_finger(PICTURES / "finger-reach-follow.gif")


def _ants() -> NDArray[np.uint8]:
    return _row(ANTS)


def _vehicles() -> NDArray[np.uint8]:
    """Four vehicles from outside, and below each what its camera sees."""
    pairs = [_seen(name) for name in VEHICLES]
    rows = [np.concatenate(row, axis=1) for row in zip(*pairs, strict=True)]
    return np.concatenate(rows)


_SEEDS: Final = (0, 1, 2, HELD_OUT[0])


def _sheet(world: str) -> NDArray[np.uint8]:
    """Vehicles of a world on four courses; see the docstring of this script."""
    vehicles = ["boat"] if world == FLOODED else [name for name in HOME if HOME[name] == world]
    rows: list[NDArray[np.uint8]] = []
    for name in vehicles:
        for seed in _SEEDS:
            drawn = Look.random(world, np.random.default_rng(seed))
            look = drawn if seed == _SEEDS[-1] else None
            here = MujocoWorld(name, world, seed, size=_SIZE, look=look)
            seen = here.picture()
            through = [lens(seen, seed) for lens in LENSES.values()]
            outside = [
                here.outside(*_SIZE),
                here.outside(*_SIZE, 2.0 * here.reach, azimuth_rad=_BEHIND),
            ]
            here.close()
            rows.append(np.concatenate([seen, *through, *outside], axis=1))
    return np.concatenate(rows)


_BEHIND: Final = math.radians(15.0)


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


_FILM_SIZE: Final = {"width": 400, "height": 300}
_FILM_STEPS: Final = 200
_FILM_SKIP: Final = 4
_FILM_COLOURS: Final = 256


def _film_finger(path: Path) -> None:
    """Film the shipped policies: two targets reached, and a figure eight followed."""
    reach = EnvRef("shapechanger/Finger-v1", {})
    follow = EnvRef("shapechanger/FingerTrack-v1", {"path": "figure-eight"})
    films = [_filmed(reach, "reach", (1, 4)), _filmed(follow, "track", (1,))]
    frames = [Image.fromarray(np.concatenate(pair, axis=1)) for pair in zip(*films, strict=True)]
    # One palette for all frames, so that colours do not flicker, with those of thin tendons.
    palette = frames[-1].quantize(_FILM_COLOURS, Image.Quantize.MAXCOVERAGE)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    drawn[0].save(
        path,
        save_all=True,
        append_images=drawn[1:],
        duration=20 * _FILM_SKIP,
        loop=0,
        optimize=True,
    )


def _filmed(env_ref: EnvRef, name: str, seeds: tuple[int, ...]) -> list[NDArray[np.uint8]]:
    """Frames of a shipped policy, for the same time from each start."""
    policy = load_policy(POLICIES[name])
    env = cast("Any", env_ref.make(render_mode="rgb_array", **_FILM_SIZE))
    frames: list[NDArray[np.uint8]] = []
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        for step in range(_FILM_STEPS // len(seeds)):
            if step % _FILM_SKIP == 0:
                frames.append(env.render())
            observation, *_ = env.step(policy.act(observation[None])[0])
    env.close()
    return frames


def _row(names: tuple[str, ...]) -> NDArray[np.uint8]:
    """Bodies side by side."""
    envs = [cast("Any", EnvRef(f"shapechanger/{name}-v1").make().unwrapped) for name in names]
    reach = 0.8 * max(env.reach for env in envs)
    row = np.concatenate([env.picture(*_SIZE, reach) for env in envs], axis=1)
    for env in envs:
        env.close()
    return row


def _seen(name: str) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """A vehicle after some seconds of its expert's driving, from outside and through its camera."""
    env = cast("Any", EnvRef(f"shapechanger/{name}-v1").make())
    picture, _ = env.reset(seed=3)
    expert = env.unwrapped.demonstrator(seed=0)
    expert.begin()
    for _ in range(round(_DRIVEN_S * env.metadata["render_fps"])):
        picture, *_ = env.step(expert.act()[1])
    outside = env.unwrapped.picture(*_SIZE)
    env.close()
    seen = Image.fromarray(picture).resize(_SIZE, Image.Resampling.NEAREST)
    return outside, np.asarray(seen)


if __name__ == "__main__":
    main()
