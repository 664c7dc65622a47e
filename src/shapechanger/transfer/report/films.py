"""Film the policies of a study: source, zero-shot and every trained arm."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef, hold_out, measures_of
from shapechanger.reports.films import write_film
from shapechanger.transfer.body_map import BodyMap, MappedEnv
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, Act
from shapechanger.transfer.plan import SOURCE, Run
from shapechanger.transfer.report.suite import FilmStrip
from shapechanger.transfer.report.verdict import finals
from shapechanger.transfer.runs import learner_of

if TYPE_CHECKING:
    from shapechanger.transfer.study import Study

_WIDTH, _HEIGHT = 240, 180
# Frames are drawn this many times larger, and averaged: multisampling takes longer without a GPU.
_FINER: Final = 2
_FILM_S: Final = 10.0
_PICTURES: Final = 6
_GAP: Final = 4
# View of a vehicle: radius around it, m, and directions from its heading, rad: from behind, or
# from the front if a wall hides the vehicle.
_REACH_M: Final = 0.45
_FOLLOWING_RAD: Final = (0.4, -0.4, 0.0, 2.7, -2.7)


class _Scene(NamedTuple):
    """One policy in one env."""

    name: str
    env: EnvRef
    act: Act
    body_map: BodyMap | None = None


def film_study(
    study: Study,
    folder: Path,
    film: Path | None = None,
    *,
    source_policy: Path | None = None,
    shadows: bool = False,
) -> list[FilmStrip]:
    """Play each arm's median seed for up to ten seconds, and return a strip of images of each.

    All are reset with the same seed. If `film` is a file, a film of all scenes side by side is
    written to it. The source policy is the study's unless a file is given. Robots are not filmed.
    """
    strips: list[FilmStrip] = []
    rows: list[NDArray[np.uint8]] = []
    fps = 0.0
    # A vehicle's env renders its camera, so it is filmed from outside.
    drives = "demonstrations" in study.plan.settings.takes
    scenes = _scenes(study, folder, source_policy, drives)
    # Bodies of one family are drawn at the same scale.
    views = [("", 0.0) if drives else _view_of(scene.env) for scene in scenes]
    distances: dict[str, float] = {}
    for family, distance in views:
        distances[family] = max(distance, distances.get(family, 0.0))
    for scene, (family, _) in zip(scenes, views, strict=True):
        frames, fps, measured = _play(scene, distances[family], shadows, drives)
        if not frames:
            return []
        gap = np.full((_HEIGHT, _GAP, 3), 255, np.uint8)
        places = np.linspace(0, len(frames) - 1, _PICTURES).round().astype(int).tolist()
        pieces: list[NDArray[np.uint8]] = []
        for place in places:
            pieces += [gap, frames[place]]
        row = np.concatenate(pieces[1:], axis=1)
        jpeg = cast("Any", iio).imwrite("<bytes>", row, extension=".jpg", quality=80)
        strips.append(FilmStrip(f"{scene.name}: {measured}", jpeg))
        rows.append(np.stack(frames))
    if film is not None and rows:
        longest = max(len(row) for row in rows)
        # The last frame of an episode that ended is repeated.
        padded = [np.concatenate([row, row[-1:].repeat(longest - len(row), 0)]) for row in rows]
        side_by_side: NDArray[np.uint8] = np.concatenate(padded, axis=2)
        write_film([*side_by_side], film, fps)
    return strips


def _view_of(env_ref: EnvRef) -> tuple[str, float]:
    """Return the family of an env's body, and the distance of the camera, m; ("", 0) without."""
    with closing(env_ref.make()) as env:
        inner: Any = env.unwrapped
        family = str(getattr(inner, "family_name", ""))
        return family, inner.mujoco_renderer.default_cam_config["distance"] if family else 0.0


def view_distance(env_ref: EnvRef) -> float:
    """Return the distance from which frames of an env of a family show its body, m."""
    return _view_of(env_ref)[1]


def _scenes(study: Study, folder: Path, given: Path | None, drives: bool) -> list[_Scene]:
    plan, scenes = study.plan, list[_Scene]()
    learner = learner_of(plan.learner, plan.settings)

    def policy(run: Run) -> Act:
        file = given if given is not None and run.kind == SOURCE else run.policy_file(folder)
        return learner.load(file).act

    trained = bool(study.of(SOURCE))
    if has_source := trained or given is not None:
        middle = Run(SOURCE, median_index(study, SOURCE) if trained else 0)
        scenes.append(_Scene("source, in the source", plan.task.source, policy(middle)))
    for arm in sorted(plan.arms, key=lambda arm: arm == "scratch"):  # The baseline comes last.
        run = Run(arm, median_index(study, arm))
        target = plan.target_of(run)
        if plan.trains(arm):
            scenes.append(_Scene(arm, target, policy(run)))
        elif has_source:
            source = policy(Run(SOURCE, run.index))
            scenes.append(_Scene(arm, target, source, None if drives else plan.body_map))
    return scenes


def median_index(study: Study, kind: str) -> int:
    """Return the index of the run with the median final measure; 0 if a run lacks a measure."""
    values = finals(study, kind)
    if np.isnan(values).any():
        return 0
    return int(np.argsort(values, kind="stable")[(values.size - 1) // 2])


def _play(
    scene: _Scene, distance: float, shadows: bool, drives: bool
) -> tuple[list[NDArray[np.uint8]], float, str]:
    """Return frames, their rate, Hz, and a text with the default measure over them."""
    size: dict[str, Any] = {}
    if not drives:
        finer = {"width": _FINER * _WIDTH, "height": _FINER * _HEIGHT}
        size = {"render_mode": "rgb_array", **finer, **({"shadows": shadows} if distance else {})}
    with closing(scene.env.make(**size)) as env:
        inner: Any = env.unwrapped
        if distance:
            inner.mujoco_renderer.default_cam_config["distance"] = distance

        def frame() -> NDArray[Any]:
            if drives:
                return inner.world.outside(_WIDTH, _HEIGHT, _REACH_M, azimuth_rad=_FOLLOWING_RAD)
            parts = np.asarray(env.render()).reshape(_HEIGHT, _FINER, _WIDTH, _FINER, 3)
            return parts.mean(axis=(1, 3)).astype(np.uint8)

        if drives and not hasattr(inner, "world"):
            return [], 0.0, ""  # A real robot cannot be filmed.
        hold_out(env)
        fps = float(env.metadata["render_fps"])
        measure = measures_of(env)[0]
        acting = env if scene.body_map is None else MappedEnv(env, scene.body_map)
        observation, _ = acting.reset(seed=EVALUATION_SEED)
        frames: list[NDArray[np.uint8]] = [frame()]
        steps, total, over = round(_FILM_S * fps), 0.0, False
        while not over and len(frames) < steps:
            action = scene.act(np.asarray(observation)[None])[0]
            observation, reward, terminated, truncated, info = acting.step(action)
            value = float(info[measure.key]) if measure.key else float(reward)
            total = value if measure.key and measure.over == "end" else total + value
            frames.append(frame())
            over = terminated or truncated
        value = total / steps if measure.over == "episode" else total
        fell = f", ends after {len(frames) / fps:.1f} s" if over and len(frames) < steps else ""
        unit = "" if measure.unit == "1" else f" {measure.unit}"
        return frames, fps, f"{measure.name} {value:.2f}{unit}{fell}"
