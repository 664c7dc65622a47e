"""Replay of an episode in an env, with the differences, and as a video."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import EnvRef
from shapechanger.demos.episodes import Episode
from shapechanger.demos.jpeg import BACKGROUND, decode_picture, overlay
from shapechanger.demos.recording import QUALITY, ObservationEncoder
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.reports.films import require_film, write_film


def play_in_env(episode: Episode, ref: EnvRef) -> list[str]:
    """Replay an episode in an env from the recorded seed, and return sentences on the differences.

    The applied actions are replayed where they are known, because the frames follow from them; the
    expert's intended actions may differ.
    """
    header, kept = episode.header, episode.kept
    gaps: list[NDArray[np.float64]] = []
    picture_gaps: list[float] = []
    rewards: list[tuple[float, float]] = []
    # With the recorded arguments if it is the recorded env.
    kwargs = header.env_kwargs if ref.id == header.env else {}
    made = EnvRef(ref.id, {**kwargs, **ref.kwargs}).make(max_episode_steps=-1)
    with closing(made) as env:
        encoder = ObservationEncoder(env, QUALITY)
        recorded = Layout.from_json(header.action_layout)
        if [(f.name, f.unit, f.shape) for f in encoder.action_layout] != [
            (f.name, f.unit, f.shape) for f in recorded
        ]:
            raise DemosError(
                f"{ref} moves {', '.join(encoder.action_layout.names)}, and {episode.path.name} "
                f"was recorded with {', '.join(recorded.names)}."
            )
        states = encoder.state_layout
        if states is not None and states.to_json() != header.state_layout:
            states = None  # States that differ in meaning are not compared.
        observation, info = env.reset(
            seed=header.seed, options=cast("Any", header.notes.get("reset_options"))
        )
        played, ended = 0, ""
        for step in kept:
            seen = encoder.encode(observation, info)
            if states is not None:
                gaps.append(np.abs(np.array(seen.state) - np.array(step.state)))
            if (jpeg := episode.jpeg(step)) is not None and seen.jpeg is not None:
                old = decode_picture(jpeg, step.frame)
                new = decode_picture(seen.jpeg, "the env's image")
                if old.shape == new.shape:
                    picture_gaps.append(float(np.abs(old.astype(float) - new).mean()))
            values = step.action if step.applied is None else step.applied
            observation, reward, terminated, truncated, info = env.step(
                np.array(values, np.float32)
            )
            played += 1
            if step.reward is not None:
                rewards.append((step.reward, float(reward)))
            if terminated or truncated:
                ended = "; the episode ended there" if played < len(kept) else ""
                break
    lines = _picture_lines(picture_gaps) + _state_lines(np.array(gaps), states)
    if rewards:
        then, now = np.sum(rewards, axis=0)
        lines.append(f"return {then:.2f} when recorded, {now:.2f} now")
    return [
        f"played {played} of {len(kept)} steps in {ref}{ended}",
        *_caveats(episode),
        *(lines or ["nothing to compare"]),
    ]


def _caveats(episode: Episode) -> list[str]:
    """Return reasons why a replay cannot be identical."""
    caveats: list[str] = []
    if episode.header.seed is None:
        caveats.append("it was recorded without a seed, so it starts elsewhere")
    kept = episode.kept
    if kept[0].index != 0 or kept[-1].index - kept[0].index != len(kept) - 1:
        caveats.append("dropped steps were not played, so later steps start elsewhere")
    if any(step.applied is None for step in kept):
        caveats.append("applied actions are unknown, so the decided ones were played")
    return caveats


def _picture_lines(gaps: list[float]) -> list[str]:
    """Describe the mean differences of images, of 255."""
    if not gaps:
        return []
    if not any(gaps):
        return ["the images are the same in every step"]
    mean = f"images differ by {np.mean(gaps):.1f} of 255 on average"
    return [f"{mean}, {gaps[-1]:.1f} at the end"]


def _state_lines(gaps: NDArray[np.float64], layout: Layout | None) -> list[str]:
    """Describe the differences of states, shape (n, size of the layout)."""
    if layout is None or not gaps.size:
        return []
    if not np.nanmax(gaps, initial=0.0):
        return ["the state is the same in every step"]
    return [
        f"{layout[name]} differs by {np.nanmean(of_one):.3g} on average, "
        f"{np.nanmax(of_one):.3g} at most"
        for name, place in layout.slices.items()
        if np.nanmax(of_one := gaps[:, place], initial=0.0)
    ]


_WITHOUT_CAMERA: Final = (40, 480, 3)


def write_episode_film(episode: Episode, path: Path) -> str:
    """Write the kept steps of an episode as a video, and return a sentence on it."""
    require_film(path)
    layout = Layout.from_json(episode.header.action_layout)
    frames: list[NDArray[Any]] = []
    size = None
    for step in episode.kept:
        jpeg = episode.jpeg(step)
        picture = (
            np.full(_WITHOUT_CAMERA, BACKGROUND, np.uint8)
            if jpeg is None
            else decode_picture(jpeg, f"{episode.path}/frames/{step.frame}")
        )
        frame = overlay(picture, step, layout)
        size = size or frame.shape
        if frame.shape == size:  # A video has one frame size; other frames are skipped.
            frames.append(frame)
    write_film(frames, path, episode.header.control_hz)
    left = len(episode.kept) - len(frames)
    rest = f"; {left} images of another size are left out" if left else ""
    seconds = len(frames) / episode.header.control_hz
    return f"wrote {path}: {len(frames)} steps, {seconds:.1f} s{rest}"
