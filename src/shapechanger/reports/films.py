"""Images and videos as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, cast

from numpy.typing import NDArray

from shapechanger.errors import OutputError, needing_extra
from shapechanger.files import require_file

with needing_extra("sim"):
    import imageio.v3 as iio

_WEBM: Final = ".webm"
_FILMS: Final = (".avi", ".gif", ".mkv", ".mov", ".mp4", _WEBM)
# Constant quality, and a speed setting at which encoding takes as long as rendering.
_VP9: Final = {
    "codec": "libvpx-vp9",
    "output_params": ["-crf", "36", "-b:v", "0", "-cpu-used", "3", "-row-mt", "1"],
}


def require_film(path: Path) -> None:
    """Raise OutputError unless a path is writable and has the suffix of a video."""
    if path.suffix.lower() not in _FILMS and not path.is_dir():
        raise OutputError(f"Cannot write {path}: a film ends with one of {', '.join(_FILMS)}.")
    require_file(path)


def write_film(frames: list[NDArray[Any]], path: Path, fps: float) -> None:
    """Write frames, each of shape (height, width, 3), as a video."""
    encoding = _VP9 if path.suffix.lower() == _WEBM else {}
    write_picture(frames, path, fps=fps, macro_block_size=1, **encoding)


def write_picture(content: Any, path: Path, **options: Any) -> None:
    """Write an image, (height, width, 3), or the frames of a film, in the format of the suffix."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        cast("Any", iio).imwrite(path, content, **options)
    except (OSError, ValueError) as error:
        # The encoder's message includes its command and its output.
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
        raise OutputError(f"Cannot write {path}: {reason}.") from error
