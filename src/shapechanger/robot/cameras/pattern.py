"""Camera driver with a moving test pattern that encodes its time of capture as a barcode."""

from __future__ import annotations

import binascii
from typing import Final

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame, Pace

_BARCODE_BITS: Final = 48
"""Bits of the number. In nanoseconds they count 78 hours, and then start again."""

_BYTES: Final = _BARCODE_BITS // 8
_COLUMNS: Final = 32
_ROWS: Final = 2
_LEAST_WIDTH: Final = 96  # Pixels: 3 by 4 is the smallest cell that survives JPEG.
_LEAST_CELL_HEIGHT: Final = 4  # Pixels: two rows fill one row of 8-pixel JPEG blocks.

# The check starts at a value other than 0, so that black or white images are not barcodes.
_CHECK_START: Final = 0xFFFF


def barcode_rows(width: int) -> int:
    """Return the height of a barcode in an image of this width, pixels."""
    return _ROWS * max(_LEAST_CELL_HEIGHT, width // 40)


def draw_barcode(image: NDArray[np.uint8], number: int) -> None:
    """Draw the lowest 48 bits of a number over the first rows of an image.

    Args:
        image: The image, shape (height, width, 3), at least 96 pixels wide; changed in place.
        number: At least 0.
    """
    height, width = image.shape[:2]
    rows = barcode_rows(width)
    if width < _LEAST_WIDTH or height < rows or number < 0:
        raise ValueError(
            f"A barcode needs a number of at least 0, not {number}, and an image of at least "
            f"{_LEAST_WIDTH} by {rows} pixels, not {width} by {height}."
        )
    data = (number % 2**_BARCODE_BITS).to_bytes(_BYTES, "big")
    data += binascii.crc_hqx(data, _CHECK_START).to_bytes(2, "big")
    cells = np.unpackbits(np.frombuffer(data, np.uint8)).reshape(_ROWS, _COLUMNS) * np.uint8(255)
    cell_height, cell_width = rows // _ROWS, width // _COLUMNS
    drawn = cells.repeat(cell_height, axis=0).repeat(cell_width, axis=1)
    image[:rows, : drawn.shape[1]] = drawn[..., np.newaxis]


def read_barcode(image: NDArray[np.uint8]) -> int | None:
    """Read the number that `draw_barcode` drew; None without a barcode.

    Args:
        image: The image, shape (height, width, 3).
    """
    height, width = image.shape[:2]
    rows = barcode_rows(width)
    if width < _LEAST_WIDTH or height < rows:
        return None
    cell_height, cell_width = rows // _ROWS, width // _COLUMNS
    cells = image[:rows, : _COLUMNS * cell_width].reshape(
        _ROWS, cell_height, _COLUMNS, cell_width, -1
    )
    bits = cells.mean(axis=(1, 3, 4)) > 127.5  # (2, 32)
    data = np.packbits(bits).tobytes()
    if binascii.crc_hqx(data[:_BYTES], _CHECK_START) != int.from_bytes(data[_BYTES:], "big"):
        return None
    return int.from_bytes(data[:_BYTES], "big")


class Pattern:
    """Camera with drifting colours; see `Camera`. It has no settings and ignores `flip`."""

    def __init__(self, plan: CameraPlan) -> None:
        self._width, self._height = plan.size
        if self._width < _LEAST_WIDTH or self._height < barcode_rows(self._width):
            raise RobotError(
                f"A test pattern of {self._width} by {self._height} pixels is too small for its "
                "barcode, which needs a width of at least 96."
            )
        self._quality = plan.jpeg_quality
        self._pace = Pace(plan.fps)

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        captured_ns = self._pace.wait()
        image = self._drawn(captured_ns)
        draw_barcode(image, captured_ns)
        jpeg = simplejpeg.encode_jpeg(image, self._quality, colorsubsampling="420")
        return Frame(jpeg, captured_ns, encoded_here=True)

    def close(self) -> None:
        """Interrupt a waiting `read`."""
        self._pace.close()

    def _drawn(self, captured_ns: int) -> NDArray[np.uint8]:
        shift = captured_ns // 20_000_000  # 50 pixels per second.
        across = np.arange(self._width) + shift
        down = np.arange(self._height)[:, np.newaxis]
        image = np.empty((self._height, self._width, 3), np.uint8)
        image[..., 0] = across * 2 % 256
        image[..., 1] = down * 2 % 256
        image[..., 2] = (across + down) % 256
        return image
