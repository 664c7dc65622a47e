"""Read files and images of datasets within limits, and create folders atomically.

A text may have up to `MAX_TEXT_BYTES`, an image `MAX_PICTURE_BYTES` and `MAX_PIXELS`, and
compressed data `MAX_UNPACKED` bytes. Only regular files are read. Functions that read raise
`DemosError` for invalid input, and `MissingExtra` if a package is not installed.
"""

from __future__ import annotations

import csv
import io
import json
import os
import secrets
import shutil
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import chain, repeat
from pathlib import Path
from typing import Annotated, Any, Final, Literal, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger import files
from shapechanger.demos.episodes import Driver, EpisodeHeader
from shapechanger.demos.episodes.records import MAX_PICTURE_BYTES, MAX_TEXT_BYTES
from shapechanger.demos.jpeg import MAX_PIXELS, decode_picture, encode_picture
from shapechanger.errors import DemosError, LayoutError, MissingExtra, OutputError, translate_errors
from shapechanger.files import read_file, reading, writing

MAX_UNPACKED: Final = 64 << 20  # Unpacked bytes in memory; `MAX_PIXELS` need 48 MiB.
MAX_VALUES: Final = 1 << 17  # Largest number of values of a feature.
_JPEG, _PNG = b"\xff\xd8", b"\x89PNG"
_PNG_DEPTH: Final = slice(24, 25)  # Byte of a PNG with the number of bits per value.


def library(name: str, extra: str = "data") -> Any:
    """Import a module of a package that an extra installs."""
    with translate_errors(ImportError, to=lambda _: MissingExtra(name.split(".")[0], extra)):
        return import_module(name)


@contextmanager
def new_folder(out: Path, source: Path | None = None) -> Generator[Path]:
    """Yield a hidden folder that is renamed to `out` on success, and removed on failure.

    `out` must not exist, nor lie in the folder `source`, which is read at the same time.
    """
    if os.path.lexists(out):
        raise DemosError(f"{out} exists already: choose another name, or move it away.")
    if source is not None and out.resolve().is_relative_to(source.resolve()):
        raise DemosError(f"{out} lies in {source}, which is never changed: choose another place.")
    part = out.with_name(f".{out.name}.{secrets.token_hex(4)}.part")
    try:
        with writing(out):
            part.mkdir(parents=True)
        yield part
        with writing(out):
            part.rename(out)
    except BaseException as error:
        shutil.rmtree(part, ignore_errors=True)
        if isinstance(error, DemosError | OutputError) and str(part) in str(error):
            # Name the folder that the user asked for.
            raise type(error)(str(error).replace(str(part), str(out))) from error
        raise


def is_inside(folder: Path, name: str) -> bool:
    """Return whether a name, after resolving links, is a path inside a folder."""
    try:
        return (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, ValueError):  # The name has a NUL, or is too long.
        return False


def inside(folder: Path, name: str, named_by: object) -> Path:
    """Return the path of a file that `named_by` names; refuse all but regular files inside."""
    if not name or not is_inside(folder, name):
        raise DemosError(f"{named_by}: the name {name!r} leaves the folder.")
    if not (folder / name).is_file():
        raise DemosError(f"There is no {folder / name}, which {named_by} names: restore it.")
    return folder / name


def read_bytes(path: Path) -> bytes:
    """Return the content of a regular file of at most `MAX_TEXT_BYTES`."""
    with reading(path, DemosError):
        return read_file(path, MAX_TEXT_BYTES)


def read_text(path: Path) -> str:
    """Return the text of a UTF-8 file without a byte order mark; line ends are kept."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DemosError(f"{path} is not text in UTF-8 (byte {error.start}).") from error


def read_table(path: Path) -> list[tuple[int, list[str]]]:
    """Read a CSV file with commas or semicolons; return its lines that are not blank."""
    text = read_text(path)
    first = text.lstrip().split("\n", 1)[0]
    separator = ";" if first.count(";") > first.count(",") else ","
    reader = csv.reader(io.StringIO(text, newline=""), strict=True, delimiter=separator)
    try:
        return [(reader.line_num, cells) for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise DemosError(f"{path}, line {reader.line_num}, is not valid CSV: {error}.") from error


def load_jpeg(image: Path | bytes | NDArray[np.uint8]) -> tuple[bytes, tuple[int, int]]:
    """Return an image as JPEG, with its width and height; PNG and BMP get JPEG quality 100.

    The image is a file, its content, or pixels, shape (height, width, 3). Errors are noun phrases,
    such as "an empty image".
    """
    if isinstance(image, np.ndarray):
        return encode_picture(image), (image.shape[1], image.shape[0])
    try:
        data = read_file(image, MAX_PICTURE_BYTES) if isinstance(image, Path) else image
    except OSError as error:
        raise DemosError(f"an image that cannot be read ({error.strerror})") from error
    if not data.strip(b"\0"):
        raise DemosError("an empty image")
    if not data.startswith((_JPEG, _PNG, b"BM")) or len(data) > MAX_PICTURE_BYTES:
        raise DemosError(
            f"an image that is not JPEG, PNG or BMP, or above {MAX_PICTURE_BYTES} bytes"
        )
    if data.startswith(_PNG) and data[_PNG_DEPTH] == b"\x10":
        raise DemosError("an image of more than 8 bits a value, like that of a depth camera")
    try:
        pixels = decode_picture(data, "") if data.startswith(_JPEG) else _pixels(data)
    except MissingExtra:
        raise
    except Exception as error:  # Pillow's errors have no common base.
        raise DemosError("a damaged image") from error
    if pixels is None:
        raise DemosError(f"an image that is partly transparent, or above {MAX_PIXELS} pixels")
    jpeg = data if data.startswith(_JPEG) else encode_picture(pixels)
    return jpeg, (pixels.shape[1], pixels.shape[0])


def image_size(shape: Sequence[int], channels: Sequence[int] = (1, 3)) -> tuple[int, int] | None:
    """Return the width and height of images with this shape, colours first or last; or None."""
    if len(shape) not in {2, 3}:
        return None
    is_last = len(shape) == 2 or shape[-1] in channels
    height, width, *colours = shape if is_last else (*shape[1:], shape[0])
    fits = height * width <= MAX_PIXELS and (not colours or colours[0] in channels)
    return (width, height) if fits else None


def _pixels(data: bytes) -> NDArray[np.uint8] | None:
    """Decode a PNG or BMP, shape (height, width, 3); None if it is too large or transparent."""
    with library("PIL.Image").open(io.BytesIO(data), formats=["PNG", "BMP"]) as opened:
        if opened.width * opened.height > MAX_PIXELS:
            return None
        pixels = np.asarray(opened.convert("RGBA"))
        return pixels[..., :3] if pixels[..., 3].min() == 255 else None


def converted(plain: Any, kind: Any, where: object, *, strict: bool = True) -> Any:
    """Convert a value to a type that msgspec supports; `where` names its source in errors."""
    return files.converted(plain, kind, DemosError, f"{where} is damaged", strict=strict)


def parse_json(text: str | bytes, where: object, kind: Any) -> Any:
    """Parse JSON and convert it as `converted` does."""
    try:
        plain = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{where} is damaged: not valid JSON ({error}).") from error
    return converted(plain, kind, where)


def read_json(path: Path, kind: Any = dict[str, Any]) -> Any:
    """Read a JSON file and convert its value as `converted` does."""
    return parse_json(read_text(path), path, kind)


class _Own(msgspec.Struct):  # Fields of each header, with the outcome and drivers.
    format: Literal[1]
    episodes: list[dict[str, Any]]


_Runs = list[tuple[Driver, Annotated[int, msgspec.Meta(ge=0, lt=1 << 31)]]]


def own_episodes(
    section: Any, where: object, count: int, found: EpisodeHeader | None = None
) -> list[tuple[EpisodeHeader, str, Iterator[Driver]]]:
    """Return the header, the outcome and the drivers of each episode that Shapechanger exported.

    `section` is their part of the dataset's metadata. It must have `count` episodes, with layouts
    and images of the sizes in `found`. For None (datasets of other programs), [] is returned.
    """
    if section is None:
        return []
    own: _Own = converted(section, _Own, where)
    episodes: list[tuple[EpisodeHeader, str, Iterator[Driver]]] = []
    for fields in own.episodes:
        with translate_errors(DemosError, LayoutError, to=lambda e: DemosError(f"{where}: {e}")):
            header = EpisodeHeader.from_json(fields)
        runs: _Runs = converted(fields.get("drivers", []), _Runs, where)
        drivers = cast("Iterator[Driver]", chain.from_iterable(repeat(*run) for run in runs))
        episodes.append((header, str(fields.get("outcome", "")), drivers))
    heads = [head for head, *_ in episodes] + ([found] if found else [])
    kinds = {(head.action_layout.size, head.state_layout.size, head.image_size) for head in heads}
    if len(episodes) != count or (found and len(kinds) > 1):
        raise DemosError(f"{where} is of another dataset: remove it if the dataset was edited.")
    return episodes
