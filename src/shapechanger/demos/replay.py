"""Replay an episode in an env and describe the differences, or write it as a video."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.episodes import Episode
from shapechanger.demos.jpeg import BACKGROUND, decode_picture, overlay
from shapechanger.demos.recording import ObservationEncoder
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.reports.films import require_film, write_film

_WITHOUT_CAMERA: Final = (40, 480, 3)  # Shape of a video frame of an episode without images.


def play_in_env(episode: Episode, ref: EnvRef) -> list[str]:
    """Replay an episode in an env from the recorded seed, and describe the differences.

    Applied actions are replayed if they are known, because they caused the recorded images. An
    expert's intended actions may differ from them.
    """
    header, kept = episode.header, episode.kept
    states: list[NDArray[np.float64]] = []  # Absolute differences of the states.
    images: list[float] = []
    rewards: list[tuple[float, float]] = []
    # The recorded arguments are used only in the recorded env.
    kwargs = header.env_kwargs if ref.id == header.env else {}
    with closing(EnvRef(ref.id, {**kwargs, **ref.kwargs}).make(max_episode_steps=-1)) as env:
        encoder = ObservationEncoder(env)
        layouts = encoder.action_layout, header.action_layout
        moved, recorded = ([(f.name, f.unit, f.shape) for f in layout] for layout in layouts)
        if moved != recorded:
            raise DemosError(
                f"The actions of {ref} are {', '.join(encoder.action_layout.names)}, but "
                f"{episode.path.name} has {', '.join(header.action_layout.names)}."
            )
        options = cast("Any", header.notes.get("reset_options"))
        observation, info = env.reset(seed=header.seed, options=options)
        over, played = False, 0
        while not over and played < len(kept):
            step = kept[played]
            jpeg, state = encoder.encode(observation, info)
            if encoder.state_layout == header.state_layout:  # Other layouts cannot be compared.
                states.append(np.abs(np.subtract(state, step.state)))
            if (before := episode.jpeg(step)) is not None and jpeg is not None:
                old, new = decode_picture(before, step.frame), decode_picture(jpeg, "of the env")
                if old.shape == new.shape:
                    images.append(float(np.abs(old.astype(float) - new).mean()))
            action = np.array(step.action if step.applied is None else step.applied, np.float32)
            observation, reward, terminated, truncated, info = env.step(action)
            over, played = bool(terminated or truncated), played + 1
            if step.reward is not None:
                rewards.append((step.reward, float(reward)))
    ended = "; the episode ended there" if played < len(kept) else ""
    said = [f"played {played} of {len(kept)} steps in {ref}{ended}"]
    # Reasons why a replay cannot be identical.
    if header.seed is None:
        said.append("it was recorded without a seed, so it starts elsewhere")
    if [step.index for step in kept] != list(range(len(kept))):
        said.append("dropped steps were not played, so later steps start elsewhere")
    if any(step.applied is None for step in kept):
        said.append("applied actions are unknown, so the decided ones were played")
    differences = list(_differences(header.state_layout, images, np.array(states), rewards))
    return said + (differences or ["nothing to compare"])


def _differences(
    layout: Layout,
    images: list[float],
    states: NDArray[np.float64],
    rewards: list[tuple[float, float]],
) -> Iterator[str]:
    """Describe differences.

    `images` are the mean differences of images, 0 to 255; `states` are absolute differences, shape
    (n, size); and `rewards` are pairs of the recorded reward and the reward of the replay.
    """
    if any(images):
        mean = np.mean(images)
        yield f"images differ by {mean:.1f} of 255 on average, {images[-1]:.1f} at the end"
    elif images:
        yield "the images are the same in every step"
    if states.size and not np.nanmax(states, initial=0.0):
        yield "the state is the same in every step"
    for name, place in layout.slices.items() if states.size else ():
        if most := np.nanmax(gaps := states[:, place], initial=0.0):
            mean = np.nanmean(gaps)
            yield f"{layout[name]} differs by {mean:.3g} on average, {most:.3g} at most"
    if rewards:
        then, now = np.sum(rewards, axis=0)
        yield f"return {then:.2f} when recorded, {now:.2f} now"


def write_episode_film(episode: Episode, path: Path) -> str:
    """Write the kept steps of an episode as a video, and return a summary."""
    require_film(path)
    layout = episode.header.action_layout
    frames: list[NDArray[Any]] = []
    for step in episode.kept:
        picture = np.full(_WITHOUT_CAMERA, BACKGROUND, np.uint8)
        if (jpeg := episode.jpeg(step)) is not None:
            picture = decode_picture(jpeg, f"{episode.path}/frames/{step.frame}")
        frame = overlay(picture, step, layout)
        if not frames or frame.shape == frames[0].shape:  # All frames of a video have one size.
            frames.append(frame)
    write_film(frames, path, episode.header.control_hz)
    left = len(episode.kept) - len(frames)
    rest = f"; {left} images of another size are left out" if left else ""
    seconds = len(frames) / episode.header.control_hz
    return f"wrote {path}: {len(frames)} steps, {seconds:.1f} s{rest}"
