"""An episode as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from shapechanger.cli.console import plain_console
from shapechanger.demos.dataset import decode_picture
from shapechanger.demos.episodes import Episode
from shapechanger.demos.overlay import blank, overlay
from shapechanger.layout import Layout

__all__ = ["film"]

_WITHOUT_CAMERA: Final = (480, 40)


def film(episode: Episode, path: Path) -> None:
    """Write the steps of an episode that count as a film.

    Raises:
        OutputError: If it cannot be written.
        DemosError: If a picture is damaged.
        MissingExtra: If the encoder is not installed.
    """
    from shapechanger.cli.pictures import require_film, write_film

    require_film(path)
    layout = Layout.from_json(episode.header.action_layout)
    frames: list[NDArray[Any]] = []
    size = None
    for step in episode.kept:
        jpeg = episode.jpeg(step)
        picture = (
            blank(_WITHOUT_CAMERA)
            if jpeg is None
            else decode_picture(jpeg, f"{episode.path}/frames/{step.frame}")
        )
        frame = overlay(picture, step, layout)
        size = size or frame.shape
        if frame.shape == size:  # A film has one size; a camera that changed it is left out.
            frames.append(frame)
    write_film(frames, path, episode.header.control_hz)
    left = len(episode.kept) - len(frames)
    rest = f"; {left} pictures of another size are left out" if left else ""
    plain_console().print(
        f"wrote {path}: {len(frames)} steps, {len(frames) / episode.header.control_hz:.1f} s{rest}",
        soft_wrap=True,
    )
