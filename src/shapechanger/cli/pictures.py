"""Write images and videos."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

from numpy.typing import NDArray

from shapechanger.cli.env_arguments import require_file
from shapechanger.errors import MissingExtra, OutputError

try:
    import imageio.v3 as iio
except ImportError as error:
    raise MissingExtra("imageio", "sim") from error

_WEBM: Final = ".webm"
_FILMS: Final = (".avi", ".gif", ".mkv", ".mov", ".mp4", _WEBM)
# Constant quality rather than a bit rate, and a speed at which encoding takes as long as rendering.
_VP9: Final = {
    "codec": "libvpx-vp9",
    "output_params": ["-crf", "36", "-b:v", "0", "-cpu-used", "3", "-row-mt", "1"],
}


def require_film(path: Path) -> None:
    """Check that a video can be written to a path.

    Raises:
        OutputError: If it is a folder, its folder is not writable, or its suffix is not that of a
            video.
    """
    if path.suffix.lower() not in _FILMS and not path.is_dir():
        raise OutputError(f"Cannot write {path}: a film ends with one of {', '.join(_FILMS)}.")
    require_file(path)


def write_picture(picture: NDArray[Any], path: Path) -> None:
    """Write an image in the format of the file's suffix.

    Args:
        picture: Shape (height, width, 3).
        path: The file.

    Raises:
        OutputError: If it cannot be written.
    """
    _write(path, picture)


def write_film(frames: list[NDArray[Any]], path: Path, fps: float) -> None:
    """Write frames as a video.

    Args:
        frames: Pictures, each of shape (height, width, 3).
        path: The file.
        fps: Frames per second.

    Raises:
        OutputError: If it cannot be written.
    """
    encoding = _VP9 if path.suffix.lower() == _WEBM else {}
    _write(path, frames, fps=fps, macro_block_size=1, **encoding)


def _write(path: Path, content: Any, **options: Any) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        cast("Any", iio).imwrite(path, content, **options)
    except (OSError, ValueError) as error:
        # The encoder's message includes its command and its output.
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
        raise OutputError(f"Cannot write {path}: {reason}.") from error
