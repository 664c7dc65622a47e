"""Draw the clips of the documentation, and the strip of the README: `make gallery`.

`python scripts/draw_pictures.py --only driving` draws one of them, and `--out FOLDER` writes to
another folder than docs/pictures. Clip and strip of the transfer between ants first run a study of
a few minutes in results/gallery, unless it is there already.
"""

import argparse
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
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
from shapechanger.files import read_json
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.reports.films import write_film
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED
from shapechanger.transfer.plan import Run
from shapechanger.transfer.references import reference_policy
from shapechanger.transfer.report.films import median_index, view_distance
from shapechanger.transfer.study import STUDY_FILE, Study
from shapechanger.vehicles.courses.course import FLOODED
from shapechanger.vehicles.envs.demonstrators import CLONES

Picture = NDArray[np.uint8]
Panel = list[Picture]
"""Frames; the panels of a clip are side by side."""

PICTURES: Final = Path(__file__).parents[1] / "docs" / "pictures"
STUDY: Final = Path("results", "gallery")
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
            # Pages show this image until the clip plays.
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
    """Make an env that renders; `view` is the camera of a body, and None for a finger."""
    of_body = {} if view is None else {"shadows": True, "default_camera_config": view}
    return ref.make(render_mode="rgb_array", width=size[0], height=size[1], **of_body)


def _film(
    ref: EnvRef, policy: Any, seconds: float, view: dict[str, Any] | None = None, seed: int = 0
) -> Panel:
    """Film a policy; the last frame is repeated after the end of the episode."""
    with closing(_made(ref, view)) as env:
        return list(_played(env, policy, round(seconds * _FPS), _FPS, seed))


def _played(env: Any, policy: Any, count: int, fps: int, seed: int) -> Iterator[Picture]:
    """Yield `count` frames of a policy, `fps` of them per second of the simulation."""
    observation, _ = env.reset(seed=seed)
    steps, over = 0, False
    for number in range(count):
        while not over and steps * fps < number * env.metadata["render_fps"]:
            action = policy.act(np.asarray(observation)[None])[0]
            observation, _, terminated, truncated, _ = env.step(action)
            steps, over = steps + 1, terminated or truncated
        yield env.render()


def _finger() -> list[Panel]:
    """Film the finger's shipped policies: it reaches two targets and follows a figure eight."""
    reach, track = (load_policy(POLICIES[name]) for name in ("reach", "track"))
    target = EnvRef("shapechanger/Finger-v1")
    path = EnvRef("shapechanger/FingerTrack-v1", {"path": "figure-eight"})
    reached = [frame for seed in (1, 4) for frame in _film(target, reach, 2.0, seed=seed)]
    return [reached, _film(path, track, 4.0, seed=1)]


# Azimuth of the camera around a vehicle; at 0 it is behind the vehicle.
_BESIDE: Final = math.radians(30.0)
_INDOORS: Final = ("corridor", FLOODED)
# Gamma of the view from outside in a world that is lit only by lamps.
_DARK: Final = 0.7
_COURSE: Final = 5


def _drive(name: str, driver: str, seconds: float, size: tuple[int, int] = _SIZE) -> list[Panel]:
    """Film a vehicle that a shipped clone drives, from outside and through its camera."""
    policy = load_policy(CLONES[driver])
    outside: Panel = []
    inside: Panel = []
    with closing(EnvRef(f"shapechanger/{name}-v1", {"courses": "held-out"}).make()) as env:
        image, _ = env.reset(seed=_COURSE)
        world = cast("Any", env.unwrapped).world
        gamma = _DARK if world.course.world in _INDOORS else 1.0
        over = False
        while not over and len(outside) < round(seconds * _FPS):
            large = world.outside(2 * size[0], 2 * size[1], 1.3 * world.reach, azimuth_rad=_BESIDE)
            outside.append((255.0 * (_halved(large) / 255.0) ** gamma).astype(np.uint8))
            seen = Image.fromarray(image).resize(size, Image.Resampling.BICUBIC)
            inside.append(np.asarray(seen))
            image, _, terminated, truncated, _ = env.step(policy.predict(image))
            over = terminated or truncated
    return [outside, inside]


def _halved(image: NDArray[Any]) -> Picture:
    """Return an image of half the size, in which each pixel averages four."""
    return np.asarray(Image.fromarray(image).reduce(2))


_STEPS: Final = 196_608
STRIP: Final = "ants-strip"


def _transferred() -> dict[str, tuple[EnvRef, Any]]:
    """Transfer from Ant to BigAnt, and return four envs with their policies, keyed by caption."""
    given = Path("reference")
    Transfer(
        source="Ant", target="BigAnt", source_policy=given, seeds=2, steps=_STEPS, out=STUDY
    ).run()
    study = read_json(STUDY / STUDY_FILE, Study, f"delete {STUDY}")
    source = load_policy(reference_policy("shapechanger/Ant-v1"))
    ant, big = study.plan.task.source, study.plan.task.target
    tuned, scratch = (
        load_policy(Run(arm, median_index(study, arm)).policy_file(STUDY))
        for arm in ("fine-tune", "scratch")
    )
    return {
        "Ant, its reference policy": (ant, source),
        "BigAnt, the same policy": (big, source),
        f"BigAnt, the same policy after {_STEPS:,} steps of fine-tuning": (big, tuned),
        f"BigAnt, a policy from scratch after {_STEPS:,} steps": (big, scratch),
    }


def _film_transfer() -> list[Panel]:
    shown = _transferred().values()
    view = {"distance": max(view_distance(ref) for ref, _ in shown)}
    return [_film(ref, policy, 10.0, view, EVALUATION_SEED) for ref, policy in shown]


# Size of a photograph in pixels, width of the floor in it, its duration and the camera's distance.
_STRIP: Final = 1170, 110
_STRIP_M: Final = 22.0
_STRIP_S: Final = 5
_AWAY_M: Final = 40.0
_VISIBLE: Final = 12  # Smallest difference of a pixel from the empty floor, of 255.


def _photograph_transfer(path: Path) -> None:
    """Draw one photograph per policy, which a fixed camera exposes once a second."""
    shown = _transferred()
    figure = Figure(figsize=(9.0, 1.1 * len(shown)), layout="constrained")
    for axes, caption in zip(figure.subplots(len(shown), 1), shown, strict=True):
        photograph, distance_m = _photographed(*shown[caption])
        axes.imshow(photograph, aspect="equal")
        title = f"{caption}: {distance_m:.1f} m in {_STRIP_S} s"
        axes.set_title(title, fontsize=9, loc="left", pad=2)
        axes.axis("off")
    figure.savefig(path, dpi=130, pil_kwargs={"quality": 80})


def _photographed(ref: EnvRef, policy: Any) -> tuple[Picture, float]:
    """Return a multiple exposure of an ant that walks past a fixed camera, and its progress, m."""
    wide, high = _STRIP
    view = {"lookat": np.array([_STRIP_M / 2 - 2.0, 0.0, 0.4]), "distance": _AWAY_M}
    view |= {"azimuth": 90.0, "elevation": -6.0}
    with closing(_made(ref, view, (2 * wide, 2 * high))) as env:
        data, model = env.unwrapped.data, env.unwrapped.model
        tangent = _STRIP_M * high / wide / 2.0 / _AWAY_M
        model.vis.global_.fovy = math.degrees(2.0 * math.atan(tangent))
        played = _played(env, policy, _STRIP_S + 1, 1, EVALUATION_SEED)
        exposures = [(frame, float(data.qpos[0])) for frame in played]
        data.qpos[2] = -100.0  # Below the floor, where it is not in view.
        mujoco.mj_forward(model, data)
        photograph = empty = env.render().astype(int)
    for frame, _ in exposures:
        is_ant = np.abs(frame.astype(int) - empty).max(axis=2, keepdims=True) > _VISIBLE
        photograph = np.where(is_ant, frame, photograph)
    return _halved(photograph.astype(np.uint8)), exposures[-1][1] - exposures[0][1]


CLIPS: Final[Mapping[str, Callable[[], list[Panel]]]] = {
    "walking": lambda: _bodies("Ant AmputatedAnt BigAnt ExtendedAnt", seconds=8.0),
    # Starts vary more than in training, so that the motion is visible.
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
        for name in ("Car", "Tank", "Truck", "Boat")
    ],
    "corridor": lambda: _drive("Car", "car", 12.0, (480, 360)),
    "finger-reach-follow": _finger,
    "car-to-tank": lambda: [_drive("Tank", driver, 10.0)[0] for driver in ("car", "tank")],
    "ant-to-bigant": _film_transfer,
}
"""Clips, keyed by name: functions that return their panels."""

if __name__ == "__main__":
    main()
