"""Pictures of a data set: which of them are whole, and their common size."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES, read_file
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.importing import ImportContext, counted
from shapechanger.demos.jpeg import MAX_PIXELS, decode_picture, encode_picture, picture_size
from shapechanger.errors import DemosError

_JPEG: Final = b"\xff\xd8"
_MAGIC: Final = {b"\x89PNG": "PNG", b"BM": "BMP"}
_DEEP: Final = ("I", "F")  # Pillow's modes of more than 8 bits.


class PictureError(DemosError):
    """A picture that cannot be imported.

    Attributes:
        reason: Why, after a noun, such as "with an empty picture".
    """

    def __init__(self, path: Path, reason: str) -> None:
        super().__init__(f"{path} cannot be imported: a record {reason}.")
        self.reason = reason


def check_pictures(
    paths: Sequence[Path], names: Sequence[str], what: str, context: ImportContext
) -> tuple[list[bool], tuple[int, int] | None]:
    """Decode each picture once, and leave out the records whose pictures are not whole.

    All pictures of a data set have one size, which is the most frequent one.

    Args:
        paths: File of each record.
        names: Name of each record.
        what: What a record is called, in the singular.
        context: Findings of the import.

    Returns:
        Whether each picture can be imported, and their width and height; None without any.
    """
    sizes: list[tuple[int, int] | None] = []
    encoded = 0
    for path, name in zip(paths, names, strict=True):
        try:
            jpeg, was_jpeg = read_picture(path)
            if was_jpeg:
                try:
                    decode_picture(jpeg, str(path))
                except DemosError as error:
                    raise PictureError(path, "with a damaged picture") from error
            encoded += not was_jpeg
            sizes.append(picture_size(jpeg, str(path)))
        except PictureError as error:
            context.leave_out(what, error.reason, name)
            sizes.append(None)
    counts = Counter(size for size in sizes if size is not None)
    if not counts:
        return [False] * len(paths), None
    common = counts.most_common(1)[0][0]
    for size, name in zip(sizes, names, strict=True):
        if size not in {None, common}:
            reason = "with a picture of another size than {} x {} pixels".format(*common)
            context.leave_out(what, reason, name)
    if encoded:
        context.note(f"{counted(encoded, 'picture')} encoded as JPEG of quality 100.")
    return [size == common for size in sizes], common


def read_picture(path: Path) -> tuple[bytes, bool]:
    """Read a picture as JPEG; PNG and BMP are encoded with quality 100.

    Args:
        path: The file.

    Returns:
        The JPEG, and whether it was one. It was not decoded then.

    Raises:
        PictureError: If it is missing, empty, of another format, damaged or too large.
        MissingExtra: If a package that is needed is not installed.
    """
    try:
        data = read_file(path, MAX_PICTURE_BYTES)
    except FileNotFoundError as error:
        raise PictureError(path, "with a picture that is missing") from error
    except OSError as error:
        reason = f"with a picture that cannot be read ({error.strerror or error})"
        raise PictureError(path, reason) from error
    if data.startswith(_JPEG):
        return data, True
    if not data.strip(b"\0"):
        raise PictureError(path, "with an empty picture")
    form = next((form for magic, form in _MAGIC.items() if data.startswith(magic)), "")
    if not form:
        raise PictureError(path, "with a picture that is not JPEG, PNG or BMP")
    image = library("PIL.Image")
    try:
        with image.open(io.BytesIO(data), formats=[form]) as opened:
            if opened.width * opened.height > MAX_PIXELS:
                raise PictureError(path, f"with a picture of more than {MAX_PIXELS} pixels")
            if opened.mode.startswith(_DEEP):
                raise PictureError(
                    path, "with a picture of more than 8 bits per pixel, as of depth"
                )
            pixels = np.asarray(opened.convert("RGB"))
    except PictureError:
        raise
    except Exception as error:  # Pillow's errors have no common base.
        raise PictureError(path, "with a damaged picture") from error
    return encode_picture(pixels), False
