"""Writing pictures and films."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

from numpy.typing import NDArray

from shapechanger.errors import MissingExtra, OutputError

try:
    import imageio.v3 as iio
except ImportError as error:
    raise MissingExtra("imageio", "sim") from error

__all__ = ["write_film", "write_picture"]


def write_picture(picture: NDArray[Any], path: Path) -> None:
    """Write a picture, shape (height, width, 3), in the format that the file's name ends with.

    Raises:
        OutputError: If it cannot be written.
    """
    _write(path, picture)


def write_film(frames: list[NDArray[Any]], path: Path, fps: float) -> None:
    """Write a film of pictures.

    Raises:
        OutputError: If it cannot be written.
    """
    _write(path, frames, fps=fps, macro_block_size=1)


def _write(path: Path, content: Any, **options: Any) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        cast("Any", iio).imwrite(path, content, **options)
    except (OSError, ValueError) as error:
        raise OutputError(f"Cannot write {path}: {error}.") from error
