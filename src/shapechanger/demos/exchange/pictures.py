"""JPEG pictures of others: looked at before they are believed, and then left as they are."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.exchange.places import cannot_read
from shapechanger.errors import DemosError, MissingExtra

__all__ = [
    "MAX_BYTES",
    "MAX_PIXELS",
    "Pictures",
    "decode",
    "encode",
    "is_grey",
    "library",
    "size_of",
]


def library(name: str) -> Any:
    """A module of h5py, Minari or simplejpeg.

    Raises:
        MissingExtra: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(name.split(".")[0], "data") from error


MAX_BYTES: Final = 16 << 20
"""Bytes of the largest JPEG that is read; as the writer of episodes."""

MAX_PIXELS: Final = 1 << 24
"""Pixels of the largest picture that is decoded, about sixteen million. The header of a JPEG of a
few hundred bytes can claim four thousand million."""

_GREY: Final = "Gray"


class Pictures:
    """Reads pictures that must all have one size.

    Args:
        size: Width and height in pixels; None for those of the first picture.
    """

    def __init__(self, size: tuple[int, int] | None = None) -> None:
        self._size = size
        self._first = ""

    def read(self, path: Path) -> bytes:
        """The bytes of a picture, which is whole.

        Raises:
            DemosError: If it cannot be read or decoded, is too large, or has another size.
        """
        try:
            if path.stat().st_size > MAX_BYTES:
                raise DemosError(
                    f"The picture {path} has {path.stat().st_size} bytes, and at most {MAX_BYTES} "
                    "are read: make it smaller."
                )
            jpeg = path.read_bytes()
        except OSError as error:
            raise cannot_read(path, error) from error
        self.check(jpeg, str(path))
        return jpeg

    def check(self, jpeg: bytes, name: str) -> None:
        """Refuse what is no whole picture of the one size.

        Args:
            jpeg: Its bytes.
            name: What to call it.

        Raises:
            DemosError: If it is not.
        """
        size = size_of(jpeg, name)
        if self._size is None:
            self._size, self._first = size, name
        if size != self._size:
            wanted = f"as {self._first}" if self._first else "as the others"
            raise DemosError(
                f"The picture {name} has {size[0]} x {size[1]} pixels, and not "
                f"{self._size[0]} x {self._size[1]} {wanted}: one data set has one size."
            )
        decode(jpeg, name)


def size_of(jpeg: bytes, name: str) -> tuple[int, int]:
    """Width and height that a JPEG claims, in pixels; nothing is decoded.

    Raises:
        DemosError: If it is no JPEG, or claims more than `MAX_PIXELS`.
        MissingExtra: If simplejpeg is not installed.
    """
    height, width, _ = _header(jpeg, name)
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The picture {name} claims {width} x {height} pixels, and at most {MAX_PIXELS} are "
            "decoded: make it smaller."
        )
    return width, height


def is_grey(jpeg: bytes, name: str) -> bool:
    """Whether a JPEG has no colours; errors as those of `size_of`."""
    return _header(jpeg, name)[2] == _GREY


def decode(jpeg: bytes, name: str, *, grey: bool = False) -> NDArray[np.uint8]:
    """The pixels of a JPEG.

    Args:
        jpeg: Its bytes.
        name: What to call it.
        grey: Whether to leave out colours.

    Returns:
        Red, green and blue, shape (height, width, 3); shape (height, width) for grey.

    Raises:
        DemosError: If it is damaged, or larger than `MAX_PIXELS`.
        MissingExtra: If simplejpeg is not installed.
    """
    size_of(jpeg, name)
    simplejpeg = library("simplejpeg")

    try:
        pixels = simplejpeg.decode_jpeg(jpeg, colorspace="GRAY" if grey else "RGB")
    except ValueError as error:
        raise DemosError(
            f"The picture {name} is damaged ({error}): put a whole one in its place, or take it "
            "out with what names it."
        ) from error
    return pixels[..., 0] if grey else pixels


def encode(pixels: NDArray[np.uint8]) -> bytes:
    """Pixels, shape (height, width, 3), as a JPEG that is as true to them as JPEG can be.

    Raises:
        MissingExtra: If simplejpeg is not installed.
    """
    simplejpeg = library("simplejpeg")

    return simplejpeg.encode_jpeg(
        np.ascontiguousarray(pixels), quality=100, colorspace="RGB", colorsubsampling="444"
    )


def _header(jpeg: bytes, name: str) -> tuple[int, int, str]:
    """Height, width and colours that a JPEG claims."""
    simplejpeg = library("simplejpeg")

    try:
        height, width, colours, _ = simplejpeg.decode_jpeg_header(jpeg)
    except ValueError as error:
        what = "is empty" if not jpeg else f"is no JPEG, or damaged ({error})"
        raise DemosError(
            f"The picture {name} {what}: put a whole one in its place, or take it out with what "
            "names it."
        ) from error
    return height, width, colours
