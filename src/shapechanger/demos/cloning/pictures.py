"""Camera pictures as a policy sees them: cropped and small, the same in training and in driving."""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError

__all__ = ["CHANNELS", "Framing", "prepare"]

CHANNELS: Final = 3
"""Red, green and blue."""

# Pictures at a time, so that the sums in 16 bits need some megabytes and not gigabytes.
_AT_A_TIME: Final = 256


class Framing(msgspec.Struct, frozen=True, kw_only=True):
    """Which part of a picture a policy sees, and how finely.

    Attributes:
        height: Rows of what it sees.
        width: Columns of what it sees.
        top: Share of the picture's rows that is cut off at the top, in [0, 1).
    """

    # A quarter of the pixels of a 160 x 120 picture, less the fifth in which a camera a few
    # centimetres above the floor sees ceiling or sky.
    height: int = 48
    width: int = 80
    top: float = 0.2

    def __post_init__(self) -> None:
        """Refuse what is no framing.

        Raises:
            CloningError: If a size is not positive, or nothing is left below the cut.
        """
        if min(self.height, self.width) < 1 or not 0.0 <= self.top < 1.0:
            raise CloningError(
                f"A policy cannot see {self.width} x {self.height} pixels below a cut of "
                f"{self.top}: sizes are positive, and the cut is in [0, 1)."
            )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Rows, columns and colours of what the policy sees."""
        return self.height, self.width, CHANNELS


def prepare(pictures: NDArray[np.uint8], framing: Framing) -> NDArray[np.uint8]:
    """Pictures as a policy sees them.

    Each pixel is the mean of a whole block of pixels, rounded half up. Pictures that already have
    the size of the framing come back as they are.

    Args:
        pictures: Red, green and blue, shape (n, H, W, 3).
        framing: What the policy sees.

    Returns:
        Shape (n, height, width, 3).

    Raises:
        CloningError: If they are no such pictures, or their size is no multiple of the framing's.
    """
    if pictures.ndim != 4 or pictures.shape[3] != CHANNELS or pictures.dtype != np.uint8:
        raise CloningError(
            "Pictures are an array of uint8 with shape (n, height, width, 3), got "
            f"{pictures.dtype} with shape {pictures.shape}."
        )
    if pictures.shape[1:] == framing.shape:
        return pictures
    first, rows, columns = _blocks(pictures.shape[1], pictures.shape[2], framing)
    small = np.empty((len(pictures), *framing.shape), np.uint8)
    for start in range(0, len(pictures), _AT_A_TIME):
        part = pictures[start : start + _AT_A_TIME, first:]
        # Adding strided views is several times faster than a mean over reshaped axes.
        total = np.full((len(part), *framing.shape), rows * columns // 2, np.uint32)
        for row in range(rows):
            for column in range(columns):
                total += part[:, row::rows, column::columns]
        small[start : start + _AT_A_TIME] = total // (rows * columns)
    return small


def _blocks(height: int, width: int, framing: Framing) -> tuple[int, int, int]:
    """The first row that is seen, and the rows and columns of one block.

    Raises:
        CloningError: If they do not come out whole.
    """
    first = round(height * framing.top)
    rows, rest_of_rows = divmod(height - first, framing.height)
    columns, rest_of_columns = divmod(width, framing.width)
    if rest_of_rows or rest_of_columns or not rows or not columns:
        raise CloningError(
            f"Pictures of {width} x {height} do not divide into the {framing.width} x "
            f"{framing.height} blocks that the policy sees below a cut of {framing.top}: "
            "record at 160 x 120 or a multiple of it, or choose another framing."
        )
    return first, rows, columns
