"""A test pattern in place of a camera: it moves, and carries its time of capture as a barcode."""

from __future__ import annotations

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.barcode import barcode_rows, draw_barcode
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.cameras.pace import Pace

__all__ = ["Pattern", "open_driver"]


class Pattern:
    """A camera that sees colours drifting by; see `Camera`."""

    def __init__(self, plan: CameraPlan) -> None:
        self._width, self._height = plan.size
        if self._width < 96 or self._height < barcode_rows(self._width):
            raise RobotError(
                f"A test pattern of {self._width} by {self._height} pixels has no room for its "
                "barcode: it needs a width of 96 at least."
            )
        self._quality = plan.jpeg_quality
        self._pace = Pace(plan.fps)

    def read(self) -> Frame:
        """Wait for the next picture; see `Camera.read`."""
        captured_ns = self._pace.wait()
        image = self._drawn(captured_ns)
        draw_barcode(image, captured_ns)
        jpeg = simplejpeg.encode_jpeg(image, self._quality, colorsubsampling="420")
        return Frame(jpeg, captured_ns)

    def close(self) -> None:
        """End a `read` that waits."""
        self._pace.close()

    def _drawn(self, captured_ns: int) -> NDArray[np.uint8]:
        shift = captured_ns // 20_000_000  # 50 pixels a second.
        across = np.arange(self._width) + shift
        down = np.arange(self._height)[:, np.newaxis]
        image = np.empty((self._height, self._width, 3), np.uint8)
        image[..., 0] = across * 2 % 256
        image[..., 1] = down * 2 % 256
        image[..., 2] = (across + down) % 256
        return image


def open_driver(plan: CameraPlan) -> Pattern:
    """Open the test pattern; it has no settings, and is never upside down."""
    return Pattern(plan)
