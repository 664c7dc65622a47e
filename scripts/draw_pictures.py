"""Draw the images and clips of README, gallery and docs: `make gallery`.

`python scripts/draw_pictures.py --only vehicles` draws one of them, and `--out FOLDER` writes
elsewhere than to docs/pictures. The clip from one ant to another trains for some minutes first, in
results/gallery; where that study has ended, it is only filmed.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Mapping, Sequence
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
from shapechanger.envs.study_films import film_study, median_index, view_distance
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
from shapechanger.vehicles.world import MujocoWorld

Picture = NDArray[np.uint8]
Film = Callable[[Path], None]

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
STUDY: Final = Path("results", "gallery")
ANTS: Final = ("Ant", "AmputatedAnt", "BigAnt", "ExtendedAnt")
PENDULUMS: Final = ("SmallInvertedPendulum", "InvertedPendulum", "BigInvertedPendulum")
DOUBLE: Final = "InvertedDoublePendulum"
RUNNERS: Final = ("HalfCheetah", "Hopper", "Walker2d", "Swimmer", "Humanoid")
VEHICLES: Final = ("Car", "Tank", "Truck", "Boat")

_SIZE: Final = 300, 240
_DRIVEN_S: Final = 3.0
_FPS: Final = 20
# Directions of view from a vehicle's heading: 0 is from behind.
_BESIDE: Final = math.radians(30.0)
_PORTRAIT: Final = math.radians(125.0)
_INDOORS: Final = ("corridor", FLOODED)
# Gamma of the view from outside where lamps are the only light.
_DARK: Final = 0.7


def main() -> None:
    """Draw every body and vehicle, and film their policies."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--only", choices=sorted({*STILLS, *CLIPS}))
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder for the pictures")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for name, draw in STILLS.items():
        if asked.only in (None, name):
            iio.imwrite(asked.out / f"{name}.jpg", draw(), quality=85)
    for name, film in CLIPS.items():
        if asked.only in (None, name):
            film(asked.out / name)


def _together() -> Picture:
    """The runners, which are bodies of different families and so each at its own scale."""
    return np.concatenate([_row((name,)) for name in RUNNERS], axis=1)


def _vehicles() -> Picture:
    """Four vehicles from outside, and below each what its camera sees."""
    pairs = [_driving(name, name.lower(), _DRIVEN_S, view=_PORTRAIT)[-1] for name in VEHICLES]
    return np.concatenate([np.concatenate(row, axis=1) for row in zip(*pairs, strict=True)])


def _finger() -> Picture:
    """A finger that follows a circle, four times."""
    circle = EnvRef("shapechanger/FingerTrack-v1", {"path": {"kind": "circle", "radius": 0.018}})
    return np.concatenate(_filmed(circle, "track", (1,))[:24:6], axis=1)


_FILM_SIZE: Final = {"width": 400, "height": 300}
_FILM_STEPS: Final = 200
_FILM_SKIP: Final = 4
_FILM_COLOURS: Final = 256


def _film_finger(stem: Path) -> None:
    """Film the shipped policies: two targets reached, and a figure eight followed."""
    reach = EnvRef("shapechanger/Finger-v1", {})
    follow = EnvRef("shapechanger/FingerTrack-v1", {"path": "figure-eight"})
    films = [_filmed(reach, "reach", (1, 4)), _filmed(follow, "track", (1,))]
    frames = [Image.fromarray(np.concatenate(pair, axis=1)) for pair in zip(*films, strict=True)]
    # One palette for all frames, so that colours do not flicker, with the colours of thin tendons.
    palette = frames[-1].quantize(_FILM_COLOURS, Image.Quantize.MAXCOVERAGE)
    drawn = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    drawn[0].save(
        stem.with_suffix(".gif"),
        save_all=True,
        append_images=drawn[1:],
        duration=20 * _FILM_SKIP,
        loop=0,
        optimize=True,
    )


def _filmed(env_ref: EnvRef, name: str, seeds: tuple[int, ...]) -> list[Picture]:
    """Frames of a shipped policy, for the same time from each start."""
    policy = load_policy(POLICIES[name])
    env = cast("Any", env_ref.make(render_mode="rgb_array", **_FILM_SIZE))
    frames: list[Picture] = []
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        for step in range(_FILM_STEPS // len(seeds)):
            if step % _FILM_SKIP == 0:
                frames.append(env.render())
            observation, *_ = env.step(policy.act(observation[None])[0])
    env.close()
    return frames


def _row(names: tuple[str, ...], share: float = 1.0) -> Picture:
    """Bodies side by side, at a scale at which a share of the largest one's reach is in view."""
    envs = [cast("Any", EnvRef(f"shapechanger/{name}-v1").make().unwrapped) for name in names]
    reach = share * max(env.reach for env in envs)
    row = np.concatenate([env.picture(*_SIZE, reach) for env in envs], axis=1)
    for env in envs:
        env.close()
    return row


# Starts that vary more than the policies' training, so that there is something to see.
_LEANING: Final = {"reset_noise_scale": 0.08}


def _clip(stem: Path, panels: list[list[Picture]]) -> None:
    """Write films side by side, and a frame of them as the image that stands for the clip."""
    frames = [np.concatenate(row, axis=1) for row in zip(*panels, strict=True)]
    write_film(cast("list[NDArray[Any]]", frames), stem.with_suffix(".webm"), _FPS)
    iio.imwrite(stem.with_suffix(".jpg"), frames[len(frames) // 3], quality=80)


def film_bodies(
    groups: Sequence[tuple[str, ...]],
    seconds: float,
    *,
    rows: int = _SIZE[1],
    farther: float = 1.0,
    **arguments: Any,
) -> Film:
    """Return a function that films the reference policies of bodies, each group at one scale.

    It keeps so many rows of pixels, below which is nothing to see, and views from farther away than
    the distance at which a body fills the frame.
    """

    def film(stem: Path) -> None:
        panels: list[list[Picture]] = []
        for names in groups:
            refs = [EnvRef(f"shapechanger/{name}-v1", arguments) for name in names]
            distance = farther * max(view_distance(ref) for ref in refs)
            films = [_moving(ref, distance, seconds) for ref in refs]
            panels += [[frame[:rows] for frame in film] for film in films]
        _clip(stem, panels)

    return film


def _moving(ref: EnvRef, distance: float, seconds: float) -> list[Picture]:
    """Frames of a body's reference policy; one that falls stays as it is."""
    policy = load_policy(reference_policy(ref.id))
    wide, high = _SIZE
    drawing = {"render_mode": "rgb_array", "width": wide, "height": high, "shadows": True}
    env = cast("Any", ref.make(**drawing))
    env.unwrapped.mujoco_renderer.default_cam_config["distance"] = distance
    fps = env.metadata["render_fps"]
    observation, _ = env.reset(seed=0)
    frames: list[Picture] = []
    taken, over = 0, False
    while len(frames) < round(seconds * _FPS):
        while not over and taken * _FPS < len(frames) * fps:
            action = policy.act(np.asarray(observation)[None])[0]
            observation, _, terminated, truncated, _ = env.step(action)
            taken, over = taken + 1, terminated or truncated
        frames.append(frames[-1] if over else env.render())
    if over:
        print(f"{ref.id} ended after {taken / fps:.1f} s")
    env.close()
    return frames


def _driving(
    name: str,
    driver: str,
    seconds: float,
    size: tuple[int, int] = _SIZE,
    view: float = _BESIDE,
) -> list[tuple[Picture, Picture]]:
    """Frames from outside and through the camera of a vehicle that a shipped clone drives."""
    env = cast("Any", EnvRef(f"shapechanger/{name}-v1", {"courses": "held-out"}).make())
    policy = load_policy(CLONES[driver])
    picture, _ = env.reset(seed=_COURSE)
    world = env.unwrapped.world
    frames: list[tuple[Picture, Picture]] = []
    for _ in range(round(seconds * _FPS)):
        outside = _outside(world, size, 1.3 * world.reach, view)
        seen = Image.fromarray(picture).resize(size, Image.Resampling.BICUBIC)
        frames.append((outside, np.asarray(seen)))
        picture, _, terminated, truncated, _ = env.step(policy.predict(picture))
        if terminated or truncated:
            break
    env.close()
    return frames


def _outside(
    world: MujocoWorld, size: tuple[int, int], reach: float, azimuth_rad: float
) -> Picture:
    """View of a vehicle from outside, with smooth edges, and exposed longer in a dark corridor."""
    wide, high = size
    drawn = world.outside(2 * wide, 2 * high, reach, azimuth_rad=azimuth_rad)
    averaged = drawn.reshape(high, 2, wide, 2, 3).mean(axis=(1, 3))
    exposure = _DARK if world.course.world in _INDOORS else 1.0
    return (255.0 * (averaged / 255.0) ** exposure).astype(np.uint8)


_COURSE: Final = 5


def _film_vehicles(stem: Path) -> None:
    """Film the four clones, from outside and below that through the camera."""
    films = [_driving(name, name.lower(), 8.0) for name in VEHICLES]
    _clip(stem, [[np.concatenate(pair) for pair in film] for film in films])


def _film_corridor(stem: Path) -> None:
    """Film the car's clone in its corridor."""
    both = _driving("Car", "car", 12.0, (480, 360))
    _clip(stem, [list(panel) for panel in zip(*both, strict=True)])


def _film_tank(stem: Path) -> None:
    """Film a tank that the car's clone drives, and one that its own does."""
    panels = [[outside for outside, _ in _driving("Tank", by, 10.0)] for by in ("car", "tank")]
    _clip(stem, panels)


_STEPS: Final = 196_608
_CAPTIONS: Final = {
    "source, in the source": "Ant, its reference policy",
    "zero-shot": "BigAnt, the same policy",
    "fine-tune": f"BigAnt, the same policy after {_STEPS:,} steps of fine-tuning",
    "scratch": f"BigAnt, a policy from scratch after {_STEPS:,} steps",
}


def _film_transfer(stem: Path) -> None:
    """Transfer from Ant to BigAnt, and film before and after, as a clip and as a strip."""
    given = Path("reference")
    Transfer(
        source="Ant", target="BigAnt", source_policy=given, seeds=2, steps=_STEPS, out=STUDY
    ).run()
    clip = stem.with_suffix(".webm")
    made = read_json(STUDY / STUDY_FILE, Study, f"delete {STUDY}")
    film_study(
        made,
        STUDY,
        clip,
        source_policy=reference_policy("shapechanger/Ant-v1"),
        shadows=True,
    )
    _photograph_transfer(made, stem.with_name("ants-strip.jpg"))
    frames = np.asarray(iio.imread(clip))
    iio.imwrite(stem.with_suffix(".jpg"), frames[len(frames) // 3], quality=80)


# The view of the strip: 22 m of the floor from the side, once a second.
_STRIP: Final = 1170, 110
_STRIP_M: Final = 22.0
_STRIP_S: Final = 5
_AWAY_M: Final = 40.0
_VISIBLE: Final = 12  # Smallest difference of a pixel from the empty floor, of 255.


def _photograph_transfer(study: Study, path: Path) -> None:
    """Draw one photograph per policy: a fixed camera, exposed once a second for five seconds."""
    source = load_policy(reference_policy("shapechanger/Ant-v1"))
    shown: dict[str, tuple[EnvRef, Any]] = {
        "source, in the source": (study.plan.task.source, source),
        "zero-shot": (study.plan.task.target, source),
    }
    for arm in ("fine-tune", "scratch"):
        policy = load_policy(Run(arm, median_index(study, arm)).policy_file(STUDY))
        shown[arm] = (study.plan.task.target, policy)
    figure = Figure(figsize=(9.0, 1.1 * len(shown)), layout="constrained")
    for axes, (arm, (ref, policy)) in zip(
        figure.subplots(len(shown), 1), shown.items(), strict=True
    ):
        picture, distance_m = _photographed(ref, policy)
        axes.imshow(picture, aspect="equal")
        title = f"{_CAPTIONS[arm]}: {distance_m:.1f} m in {_STRIP_S} s"
        axes.set_title(title, fontsize=9, loc="left", pad=2)
        axes.axis("off")
    figure.savefig(path, dpi=130, pil_kwargs={"quality": 80})


def _photographed(ref: EnvRef, policy: Any) -> tuple[Picture, float]:
    """Return a multiple exposure of an ant that walks past a fixed camera, and its way, m."""
    wide, high = _STRIP
    view = {
        "lookat": np.array([_STRIP_M / 2 - 2.0, 0.0, 0.4]),
        "distance": _AWAY_M,
        "azimuth": 90.0,
        "elevation": -6.0,
    }
    size = {"render_mode": "rgb_array", "width": 2 * wide, "height": 2 * high}
    env = cast("Any", ref.make(**size, shadows=True, default_camera_config=view))
    data, model = env.unwrapped.data, env.unwrapped.model
    model.vis.global_.fovy = math.degrees(2.0 * math.atan(_STRIP_M * high / wide / 2.0 / _AWAY_M))
    observation, _ = env.reset(seed=EVALUATION_SEED)
    start = float(data.qpos[0])
    exposures: list[Picture] = [env.render()]
    for _ in range(_STRIP_S):
        for _ in range(round(env.metadata["render_fps"])):
            observation, *_ = env.step(policy.act(np.asarray(observation)[None])[0])
        exposures.append(env.render())
    way = float(data.qpos[0]) - start
    data.qpos[2] = -100.0  # Below the floor, where it is not in view.
    mujoco.mj_forward(model, data)
    empty = env.render().astype(int)
    env.close()
    picture = empty.copy()
    for exposure in exposures:
        ant = np.abs(exposure.astype(int) - empty).max(axis=2) > _VISIBLE
        picture[ant] = exposure[ant]
    averaged = picture.reshape(high, 2, wide, 2, 3).mean(axis=(1, 3))
    return averaged.astype(np.uint8), way


STILLS: Final[Mapping[str, Callable[[], Picture]]] = {
    "ants": lambda: _row(ANTS, 0.8),
    "pendulums": lambda: _row((*PENDULUMS, DOUBLE)),
    "runners": _together,
    "vehicles": _vehicles,
    "finger": _finger,
}
"""Pictures, keyed by name."""

CLIPS: Final[Mapping[str, Film]] = {
    "walking": film_bodies((ANTS,), 8.0),
    "balancing": film_bodies((PENDULUMS, (DOUBLE,)), 5.0, rows=160, **_LEANING),
    "running": film_bodies([(name,) for name in RUNNERS], 6.0, farther=1.25),
    "driving": _film_vehicles,
    "corridor": _film_corridor,
    "finger-reach-follow": _film_finger,
    "car-to-tank": _film_tank,
    "ant-to-bigant": _film_transfer,
}
"""Clips, keyed by name; each gets the path that it writes to, without a suffix."""

if __name__ == "__main__":
    main()
