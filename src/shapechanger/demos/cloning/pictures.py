"""Pictures as a policy sees them: cropped and reduced, the same in training and in driving."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import ShapechangerError

if TYPE_CHECKING:
    from shapechanger.demos.episodes import EpisodeHeader


class CloningError(ShapechangerError, ValueError):
    """Invalid images, actions or settings."""


class PolicyError(ShapechangerError, ValueError):
    """Invalid policy file, or a policy that does not fit an env."""


CHANNELS: Final = 3
"""Red, green and blue."""

_CHUNK: Final = 256  # Images at a time, to bound the memory of the sums.
# A mean in single precision may miss a half by a rounding error, and is still rounded up.
HALF: Final = 0.5 + 1e-4


class Framing(msgspec.Struct, frozen=True, kw_only=True):
    """Crop and resolution of the images of a policy.

    Attributes:
        height: Rows of the reduced image.
        width: Columns of the reduced image.
        top: Share of the rows that is cut off at the top, in [0, 1).
    """

    # A quarter of the pixels of a 160 x 120 image, less the fifth in which a camera a few
    # centimetres above the floor sees ceiling or sky.
    height: int = 48
    width: int = 80
    top: float = 0.2

    def __post_init__(self) -> None:
        """Validate the sizes."""
        if min(self.height, self.width) < 1 or not 0.0 <= self.top < 1.0:
            raise CloningError(
                f"Invalid framing of {self.width} x {self.height} pixels below a cut of "
                f"{self.top}: sizes must be positive, and the cut in [0, 1)."
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and colours of the reduced image."""
        return self.height, self.width, CHANNELS


def prepare(pictures: NDArray[np.uint8], framing: Framing) -> NDArray[np.uint8]:
    """Crop and reduce images.

    Each pixel is the mean of the area that it covers, rounded half up: of a block of pixels where
    the size divides evenly, and weighted by the covered shares elsewhere. Images that already
    have the target size are returned unchanged.

    Args:
        pictures: Red, green and blue, shape (n, H, W, 3).
        framing: Crop and resolution.

    Returns:
        Shape (n, height, width, 3).

    Raises:
        CloningError: If the images have another type or shape.
    """
    if pictures.ndim != 4 or pictures.shape[3] != CHANNELS or pictures.dtype != np.uint8:
        raise CloningError(
            "Images must be uint8 with shape (n, height, width, 3), got "
            f"{pictures.dtype} with shape {pictures.shape}."
        )
    if pictures.shape[1:] == framing.shape:
        return pictures
    if not pictures.shape[1] or not pictures.shape[2]:
        raise CloningError(f"Images of shape {pictures.shape} have no pixels.")
    # At least one row is left.
    first = min(round(pictures.shape[1] * framing.top), pictures.shape[1] - 1)
    rows, rest_of_rows = divmod(pictures.shape[1] - first, framing.height)
    columns, rest_of_columns = divmod(pictures.shape[2], framing.width)
    if rest_of_rows or rest_of_columns or not rows or not columns:
        return _by_area(pictures[:, first:], framing)
    small = np.empty((len(pictures), *framing.shape), np.uint8)
    for start in range(0, len(pictures), _CHUNK):
        part = pictures[start : start + _CHUNK, first:]
        # Adding strided views is several times faster than a mean over reshaped axes.
        total = np.full((len(part), *framing.shape), rows * columns // 2, np.uint32)
        for row in range(rows):
            for column in range(columns):
                total += part[:, row::rows, column::columns]
        small[start : start + _CHUNK] = total // (rows * columns)
    return small


def _by_area(pictures: NDArray[np.uint8], framing: Framing) -> NDArray[np.uint8]:
    """Reduce images whose size does not divide evenly: rows first, then columns."""
    n, height, width, _ = pictures.shape
    of_rows = area_shares(height, framing.height)
    of_columns = area_shares(width, framing.width)
    small = np.empty((n, *framing.shape), np.uint8)
    for i, picture in enumerate(pictures):  # One at a time: they may be large.
        low = of_rows @ picture.reshape(height, -1).astype(np.float32)
        narrow = of_columns @ low.reshape(framing.height, width, CHANNELS)
        small[i] = np.floor(narrow + HALF)
    return small


def area_shares(before: int, after: int) -> NDArray[np.float32]:
    """Return the weight of each old pixel in each new one along one axis, shape (after, before).

    Args:
        before: Number of old pixels.
        after: Number of new pixels.
    """
    edges = np.linspace(0.0, before, after + 1)
    old = np.arange(before)
    overlap = np.minimum(edges[1:, None], old + 1) - np.maximum(edges[:-1, None], old)
    shares = np.clip(overlap, 0.0, None)
    return (shares / shares.sum(axis=1, keepdims=True)).astype(np.float32)


@dataclass
class ShrunkFrames:
    """Convert frames to a policy's view while they are read, and record their digests.

    Attributes:
        framing: Crop and resolution.
        view: Returns the frame of another camera for a frame and the header of its episode; None
            for the same camera.
        size: Rows and columns of the last frame before; None before the first.
        seen: Digests of the frames.
    """

    framing: Framing
    view: Callable[[NDArray[np.uint8], EpisodeHeader], NDArray[np.uint8]] | None = None
    size: tuple[int, int] | None = None
    seen: list[bytes] = field(default_factory=list[bytes])

    def __call__(self, picture: NDArray[np.uint8], header: EpisodeHeader) -> NDArray[np.uint8]:
        """Return the policy's view of a frame of an episode."""
        if self.view is not None:
            picture = self.view(picture, header)
        self.size = picture.shape[0], picture.shape[1]
        small = prepare(picture[None], self.framing)[0]
        self.seen.append(hashlib.sha256(picture.tobytes()).digest())
        return small

    def digest(self, actions: NDArray[np.float32]) -> str:
        """Return a digest of the demonstrations."""
        return hashlib.sha256(b"".join(self.seen) + actions.tobytes()).hexdigest()
