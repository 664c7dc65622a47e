"""What every camera driver does, and where each is found."""

from __future__ import annotations

import importlib
import os
import select
import threading
import time
from dataclasses import dataclass, field
from typing import Final, Protocol

from shapechanger.errors import RobotError, UnknownName

__all__ = ["CAMERA_DRIVERS", "Camera", "CameraPlan", "Frame", "Interruption", "Pace", "open_camera"]

CAMERA_DRIVERS: Final = {
    "picamera2": "shapechanger.robot.cameras.picamera2",
    "v4l2": "shapechanger.robot.cameras.v4l2",
    "file": "shapechanger.robot.cameras.file",
    "pipe": "shapechanger.robot.cameras.pipe",
    "pattern": "shapechanger.robot.cameras.pattern",
}
"""Module of each camera driver, by its name in a profile; each has `open_driver(plan)`."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture.

    Attributes:
        jpeg: The picture as JPEG.
        captured_ns: When it was taken, on the robot's monotonic clock.
    """

    jpeg: bytes
    captured_ns: int


@dataclass(frozen=True, slots=True)
class CameraPlan:
    """A camera, as a profile has it.

    Attributes:
        driver: Name of its driver.
        size: Width and height in pixels.
        fps: Pictures a second.
        jpeg_quality: 1 to 100.
        flip: Whether the camera hangs upside down.
        settings: What the driver needs besides.
    """

    driver: str
    size: tuple[int, int] = (160, 120)
    fps: float = 20.0
    jpeg_quality: int = 80
    flip: bool = False
    settings: dict[str, int | str] = field(default_factory=dict[str, int | str])


class Camera(Protocol):
    """A source of pictures, read by one thread."""

    def read(self) -> Frame:
        """Wait for the next picture.

        Raises:
            RobotError: If the camera does not give one any more, or gave something else.
        """
        ...

    def close(self) -> None:
        """Let go of the camera; a `read` that waits in another thread ends with an error."""
        ...


def open_camera(plan: CameraPlan) -> Camera:
    """Open a camera.

    Raises:
        UnknownName: If there is no such driver.
        RobotError: If the camera does not answer.
    """
    if plan.driver not in CAMERA_DRIVERS:
        raise UnknownName("camera driver", plan.driver, CAMERA_DRIVERS)
    return importlib.import_module(CAMERA_DRIVERS[plan.driver]).open_driver(plan)


class Interruption:
    """Waits for a descriptor until it is ready, or `set` is called in any thread."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        self._is_set = False

    def wait(self, fd: int, at_most_s: float | None = None) -> bool:
        """Wait until a descriptor can be read.

        Returns:
            Whether it can; False after `at_most_s`.

        Raises:
            RobotError: If `set` was or is called.
        """
        poll = select.poll()
        poll.register(fd, select.POLLIN)
        poll.register(self._read, select.POLLIN)
        ready = poll.poll(None if at_most_s is None else at_most_s * 1e3)
        if self._is_set:
            raise RobotError("The camera is closed.")
        return bool(ready)

    def set(self) -> None:
        """End all waiting, now and later."""
        if not self._is_set:
            self._is_set = True
            os.write(self._write, b"\0")

    def __del__(self) -> None:
        # Not in `set`: another thread may still wait on them.
        os.close(self._read)
        os.close(self._write)


class Pace:
    """So many pictures a second.

    Args:
        fps: How many.
    """

    def __init__(self, fps: float) -> None:
        self._period_ns = round(1e9 / fps)
        self._next_ns = time.monotonic_ns()
        self._closed = threading.Event()

    def wait(self) -> int:
        """Wait for the time of the next picture, and return it: nanoseconds, monotonic.

        One that is late is taken at once, and the rest keeps the rate from there.

        Raises:
            RobotError: If the camera is closed.
        """
        left_ns = self._next_ns - time.monotonic_ns()
        if self._closed.wait(max(0.0, left_ns / 1e9)):
            raise RobotError("The camera is closed.")
        now_ns = time.monotonic_ns()
        self._next_ns = max(self._next_ns, now_ns - self._period_ns) + self._period_ns
        return now_ns

    def close(self) -> None:
        """End all waiting, now and later."""
        self._closed.set()
