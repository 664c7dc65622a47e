"""Pictures of strangers: each is checked, and turned into a JPEG if it is not one."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES, read_file
from shapechanger.demos.exchange.files import library
from shapechanger.demos.exchange.format import ImportContext, counted
from shapechanger.demos.jpeg import MAX_PIXELS, decode_picture, encode_picture, picture_size
from shapechanger.errors import DemosError

_JPEG: Final = b"\xff\xd8"
_MAGIC: Final = {b"\x89PNG": "PNG", b"BM": "BMP"}
_DEEP: Final = ("I", "F")  # Pillow's modes of more than 8 bits.
_PNG_DEPTH: Final = slice(24, 25)  # Position of the number of bits of a value.
_OPAQUE: Final = 255


class PictureError(DemosError):
    """A picture that cannot be imported.

    Attributes:
        reason: Why, after a noun, such as "with an empty picture".
    """

    def __init__(self, name: object, reason: str) -> None:
        super().__init__(f"{name} cannot be imported: a record {reason}.")
        self.reason = reason


class Pictures:
    """Check of JPEGs that must be intact and of one size.

    Args:
        size: Width and height in pixels; None to take those of the first picture.

    Attributes:
        size: Width and height in pixels; None before the first picture.
    """

    def __init__(self, size: tuple[int, int] | None = None) -> None:
        self.size = size

    def check(self, jpeg: bytes, name: str, *, decode: bool = True) -> None:
        """Refuse a picture that is damaged or of another size.

        Args:
            jpeg: Its bytes.
            name: How to name it in errors.
            decode: Whether to decode it, because others encoded it.
        """
        size = picture_size(jpeg, name)
        self.size = self.size or size
        if size != self.size:
            raise DemosError(
                f"The picture {name} has {size[0]} x {size[1]} pixels, and not "
                f"{self.size[0]} x {self.size[1]} like the others: a data set has one size."
            )
        if decode:
            decode_picture(jpeg, name)


def as_jpeg(data: bytes, name: object) -> bytes:
    """Return a picture as JPEG; PNG and BMP are encoded with quality 100."""
    if data.startswith(_JPEG):
        return data  # Its users decode it.
    if not data.strip(b"\0"):
        raise PictureError(name, "with an empty picture")
    form = next((form for magic, form in _MAGIC.items() if data.startswith(magic)), "")
    if not form:
        raise PictureError(name, "with a picture that is not JPEG, PNG or BMP")
    image = library("PIL.Image")
    try:
        with image.open(io.BytesIO(data), formats=[form]) as opened:
            if opened.width * opened.height > MAX_PIXELS:
                raise PictureError(name, f"with a picture of more than {MAX_PIXELS} pixels")
            if opened.mode.startswith(_DEEP) or (form == "PNG" and data[_PNG_DEPTH] == b"\x10"):
                raise PictureError(
                    name,
                    "with a picture of more than 8 bits a value, like that of a depth camera",
                )
            if (
                opened.has_transparency_data
                and np.asarray(opened.convert("RGBA"))[..., 3].min() < _OPAQUE
            ):
                raise PictureError(name, "with a picture that is partly transparent")
            pixels = np.asarray(opened.convert("RGB"))
    except PictureError:
        raise
    except Exception as error:  # Pillow's errors have no common base.
        raise PictureError(name, "with a damaged picture") from error
    return encode_picture(pixels)


def read_picture(path: Path) -> tuple[bytes, bool]:
    """Read a picture as JPEG."""
    try:
        data = read_file(path, MAX_PICTURE_BYTES)
    except FileNotFoundError as error:
        raise PictureError(path, "with a picture that is missing") from error
    except OSError as error:
        reason = f"with a picture that cannot be read ({error.strerror or error})"
        raise PictureError(path, reason) from error
    jpeg = as_jpeg(data, path)
    return jpeg, jpeg is not data


def check_pictures(
    pictures: Sequence[tuple[Path, str]], what: str, context: ImportContext
) -> tuple[list[bool], tuple[int, int] | None]:
    """Decode each picture once, and leave out the records whose pictures are not whole.

    All pictures of a data set have one size, which is the most frequent one.
    """
    sizes: list[tuple[int, int] | None] = []
    encoded = 0
    for path, name in pictures:
        try:
            jpeg, is_new = read_picture(path)
            if not is_new:
                decode_picture(jpeg, str(path))
            encoded += is_new
            sizes.append(picture_size(jpeg, str(path)))
        except DemosError as error:
            reason = error.reason if isinstance(error, PictureError) else "with a damaged picture"
            context.leave_out(what, reason, name)
            sizes.append(None)
    counts = Counter(size for size in sizes if size is not None)
    common = counts.most_common(1)[0][0] if counts else None
    for size, (_, name) in zip(sizes, pictures, strict=True):
        if size is not None and common is not None and size != common:
            reason = "with a picture of another size than {} x {} pixels".format(*common)
            context.leave_out(what, reason, name)
    if encoded:
        context.note(f"{counted(encoded, 'picture')} encoded as JPEG of quality 100.")
    return [size is not None and size == common for size in sizes], common
