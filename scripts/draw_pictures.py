"""Draw the clips of gallery and docs, and the strip of the README: `make gallery`.

`python scripts/draw_pictures.py --only driving` draws one of them, and `--out FOLDER` writes to
another folder than docs/pictures. The clip of transfer between ants first runs a study of a few
minutes in results/gallery, unless the study is there already.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, cast

import imageio.v3 as iio
import mujoco
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from shapechanger.cli.transfer import Transfer
from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.study_films import median_index, view_distance
from shapechanger.files import read_json
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.reports.films import write_film
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED
from shapechanger.transfer.plan import Run
from shapechanger.transfer.references import reference_policy
from shapechanger.transfer.study import STUDY_FILE, Study
from shapechanger.vehicles.courses.course import FLOODED
from shapechanger.vehicles.envs.demonstrators import CLONES

Picture = NDArray[np.uint8]
Panel = list[Picture]
"""Frames; the panels of a clip are side by side."""

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
STUDY: Final = Path("results", "gallery")
_VEHICLES: Final = ("Car", "Tank", "Truck", "Boat")

_SIZE: Final = 300, 240
_FPS: Final = 20


def main() -> None:
    """Film the policies of every body and vehicle."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--only", choices=sorted([*CLIPS, STRIP]))
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder for the pictures")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, film in CLIPS.items():
        if asked.only in (None, name):
            frames = [np.concatenate(row, axis=1) for row in zip(*film(), strict=True)]
            write_film(cast("Any", frames), asked.out / f"{name}.webm", _FPS)
            # The image that stands for the clip.
            iio.imwrite(asked.out / f"{name}.jpg", frames[len(frames) // 3], quality=80)
    if asked.only in (None, STRIP):
        _photograph_transfer(asked.out / f"{STRIP}.jpg")


def _bodies(
    *groups: str, seconds: float, rows: int = _SIZE[1], farther: float = 1.0, **arguments: Any
) -> list[Panel]:
    """Film the reference policies of bodies, each group at one scale.

    Frames are cropped to the upper `rows`, because nothing is visible below. `farther` multiplies
    the distance at which a body fills the frame.
    """
    panels: list[Panel] = []
    for names in groups:
        refs = [EnvRef(f"shapechanger/{name}-v1", arguments) for name in names.split()]
        view = {"distance": farther * max(map(view_distance, refs))}
        played = [_film(ref, load_policy(reference_policy(ref.id)), seconds, view) for ref in refs]
        panels += [[frame[:rows] for frame in panel] for panel in played]
    return panels


def _made(ref: EnvRef, view: dict[str, Any] | None, size: tuple[int, int] = _SIZE) -> Any:
    """Make an env that renders; `view` is a body's camera, and None for a finger."""
    of_body = {} if view is None else {"shadows": True, "default_camera_config": view}
    return ref.make(render_mode="rgb_array", width=size[0], height=size[1], **of_body)


def _film(
    ref: EnvRef, policy: Any, seconds: float, view: dict[str, Any] | None = None, seed: int = 0
) -> Panel:
    """Film a policy; a body that falls stays as it is."""
    env = _made(ref, view)
    frames = list(_played(env, policy, round(seconds * _FPS), _FPS, seed))
    env.close()
    return frames


def _played(env: Any, policy: Any, count: int, fps: int, seed: int) -> Iterator[Picture]:
    """Yield frames of a policy; the last one again after the end of the episode."""
    observation, _ = env.reset(seed=seed)
    taken, over = 0, False
    for number in range(count):
        while not over and taken * fps < number * env.metadata["render_fps"]:
            action = policy.act(np.asarray(observation)[None])[0]
            observation, _, terminated, truncated, _ = env.step(action)
            taken, over = taken + 1, terminated or truncated
        yield env.render()


def _finger() -> list[Panel]:
    """Film the shipped policies: two targets reached, and a figure eight followed."""
    reach, track = (load_policy(POLICIES[name]) for name in ("reach", "track"))
    target = EnvRef("shapechanger/Finger-v1")
    path = EnvRef("shapechanger/FingerTrack-v1", {"path": "figure-eight"})
    reached = [frame for seed in (1, 4) for frame in _film(target, reach, 2.0, seed=seed)]
    return [reached, _film(path, track, 4.0, seed=1)]


# Direction of the view from a vehicle's heading: 0 is from behind.
_BESIDE: Final = math.radians(30.0)
_INDOORS: Final = ("corridor", FLOODED)
# Gamma of the view from outside where lamps are the only light.
_DARK: Final = 0.7
_COURSE: Final = 5


def _drive(name: str, driver: str, seconds: float, size: tuple[int, int] = _SIZE) -> list[Panel]:
    """Film a vehicle that a shipped clone drives, from outside and through its camera."""
    env = cast("Any", EnvRef(f"shapechanger/{name}-v1", {"courses": "held-out"}).make())
    policy = load_policy(CLONES[driver])
    picture, _ = env.reset(seed=_COURSE)
    world = env.unwrapped.world
    wide, high = size
    exposure = _DARK if world.course.world in _INDOORS else 1.0
    panels: list[Panel] = [[], []]
    for _ in range(round(seconds * _FPS)):
        drawn = world.outside(2 * wide, 2 * high, 1.3 * world.reach, azimuth_rad=_BESIDE)
        light = (_smooth(drawn) / 255.0) ** exposure
        panels[0].append((255.0 * light).astype(np.uint8))
        seen = Image.fromarray(picture).resize(size, Image.Resampling.BICUBIC)
        panels[1].append(np.asarray(seen))
        picture, _, terminated, truncated, _ = env.step(policy.predict(picture))
        if terminated or truncated:
            break
    env.close()
    return panels


def _smooth(drawn: NDArray[Any]) -> NDArray[np.float64]:
    """Return a picture of half the size, in which each pixel averages four."""
    high, wide, _ = drawn.shape
    return drawn.reshape(high // 2, 2, wide // 2, 2, 3).mean(axis=(1, 3))


_STEPS: Final = 196_608
STRIP: Final = "ants-strip"


def _transferred() -> dict[str, tuple[EnvRef, Any]]:
    """Transfer from Ant to BigAnt, and return env and policy before and after, by caption."""
    given, start = Path("reference"), reference_policy("shapechanger/Ant-v1")
    Transfer(
        source="Ant", target="BigAnt", source_policy=given, seeds=2, steps=_STEPS, out=STUDY
    ).run()
    study = read_json(STUDY / STUDY_FILE, Study, f"delete {STUDY}")
    tuned, scratch = (
        load_policy(Run(arm, median_index(study, arm)).policy_file(STUDY))
        for arm in ("fine-tune", "scratch")
    )
    task, source = study.plan.task, load_policy(start)
    return {
        "Ant, its reference policy": (task.source, source),
        "BigAnt, the same policy": (task.target, source),
        f"BigAnt, the same policy after {_STEPS:,} steps of fine-tuning": (task.target, tuned),
        f"BigAnt, a policy from scratch after {_STEPS:,} steps": (task.target, scratch),
    }


def _film_transfer() -> list[Panel]:
    shown = _transferred().values()
    view = {"distance": max(view_distance(ref) for ref, _ in shown)}
    return [_film(ref, policy, 10.0, view, EVALUATION_SEED) for ref, policy in shown]


# The view of the strip: 22 m of the floor from the side, once a second.
_STRIP: Final = 1170, 110
_STRIP_M: Final = 22.0
_STRIP_S: Final = 5
_AWAY_M: Final = 40.0
_VISIBLE: Final = 12  # Smallest difference of a pixel from the empty floor, of 255.


def _photograph_transfer(path: Path) -> None:
    """Draw one photograph per policy: a fixed camera, exposed once a second for five seconds."""
    shown = _transferred()
    figure = Figure(figsize=(9.0, 1.1 * len(shown)), layout="constrained")
    rows = zip(figure.subplots(len(shown), 1), shown.items(), strict=True)
    for axes, (caption, (ref, policy)) in rows:
        picture, distance_m = _photographed(ref, policy)
        axes.imshow(picture, aspect="equal")
        title = f"{caption}: {distance_m:.1f} m in {_STRIP_S} s"
        axes.set_title(title, fontsize=9, loc="left", pad=2)
        axes.axis("off")
    figure.savefig(path, dpi=130, pil_kwargs={"quality": 80})


def _photographed(ref: EnvRef, policy: Any) -> tuple[Picture, float]:
    """Return a multiple exposure of an ant that walks past a fixed camera, and its progress, m."""
    wide, high = _STRIP
    view = {"lookat": np.array([_STRIP_M / 2 - 2.0, 0.0, 0.4]), "distance": _AWAY_M}
    env = _made(ref, {**view, "azimuth": 90.0, "elevation": -6.0}, (2 * wide, 2 * high))
    data, model = env.unwrapped.data, env.unwrapped.model
    model.vis.global_.fovy = math.degrees(2.0 * math.atan(_STRIP_M * high / wide / 2.0 / _AWAY_M))
    exposures: Panel = []
    places: list[float] = []
    for exposure in _played(env, policy, _STRIP_S + 1, 1, EVALUATION_SEED):
        exposures.append(exposure)
        places.append(float(data.qpos[0]))
    data.qpos[2] = -100.0  # Below the floor, where it is not in view.
    mujoco.mj_forward(model, data)
    picture = empty = env.render().astype(int)
    env.close()
    for exposure in exposures:
        ant = np.abs(exposure.astype(int) - empty).max(axis=2, keepdims=True) > _VISIBLE
        picture = np.where(ant, exposure, picture)
    return _smooth(picture).astype(np.uint8), places[-1] - places[0]


CLIPS: Final[Mapping[str, Callable[[], list[Panel]]]] = {
    "walking": lambda: _bodies("Ant AmputatedAnt BigAnt ExtendedAnt", seconds=8.0),
    # Starts vary more than in the training of the policies, so that the motion is visible.
    "balancing": lambda: _bodies(
        "SmallInvertedPendulum InvertedPendulum BigInvertedPendulum",
        "InvertedDoublePendulum",
        seconds=5.0,
        rows=160,
        reset_noise_scale=0.08,
    ),
    "running": lambda: _bodies(
        *("HalfCheetah", "Hopper", "Walker2d", "Swimmer", "Humanoid"), seconds=6.0, farther=1.25
    ),
    "driving": lambda: [
        [np.concatenate(pair) for pair in zip(*_drive(name, name.lower(), 8.0), strict=True)]
        for name in _VEHICLES
    ],
    "corridor": lambda: _drive("Car", "car", 12.0, (480, 360)),
    "finger-reach-follow": _finger,
    "car-to-tank": lambda: [_drive("Tank", driver, 10.0)[0] for driver in ("car", "tank")],
    "ant-to-bigant": _film_transfer,
}
"""Clips, keyed by name: functions that return their panels."""

if __name__ == "__main__":
    main()
