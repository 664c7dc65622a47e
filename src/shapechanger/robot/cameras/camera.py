"""Camera interface, frames, and the registry of camera drivers."""

from __future__ import annotations

import os
import select
import threading
import time
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, Protocol

from msgspec import Meta

from shapechanger.errors import RobotError
from shapechanger.robot.hardware import load

CAMERA_DRIVERS: Final = {
    "picamera2": "shapechanger.robot.cameras.picamera2:PiCamera",
    "v4l2": "shapechanger.robot.cameras.v4l2:V4l2",
    "file": "shapechanger.robot.cameras.file:Folder",
    "pipe": "shapechanger.robot.cameras.pipe:Pipe",
    "pattern": "shapechanger.robot.cameras.pattern:Pattern",
}
"""MODULE:NAME of each camera driver, keyed by its name in a profile; called with the plan."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame.

    Attributes:
        jpeg: The image as JPEG.
        captured_ns: Time of capture on the robot's monotonic clock, ns.
        encoded_here: Whether this process encoded the JPEG from an image of the right size. Such a
            frame decodes, so it needs no further check.
        skipped: Number of bytes between this frame and the one before that are part of no frame.
    """

    jpeg: bytes
    captured_ns: int
    encoded_here: bool = False
    skipped: int = 0


_Side = Annotated[int, Meta(ge=16, le=1920, multiple_of=2)]


@dataclass(frozen=True, slots=True)
class CameraPlan:
    """A camera of a profile.

    Attributes:
        driver: Name of the driver.
        size: Width and height in pixels.
        fps: Frames per second.
        jpeg_quality: 1 to 100.
        flip: Whether the camera is mounted upside down.
        pitch_deg: Angle of the optical axis below the horizon, degrees; None if unknown.
        fovy_deg: Vertical field of view, degrees; None if unknown.
        settings: Settings of the driver.
    """

    driver: str
    size: tuple[_Side, _Side] = (160, 120)
    fps: Annotated[float, Meta(ge=1, le=120)] = 20.0
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 80
    flip: bool = False
    pitch_deg: Annotated[float, Meta(ge=-45, le=45)] | None = None
    fovy_deg: Annotated[float, Meta(ge=10, le=170)] | None = None
    settings: dict[str, Any] = field(default_factory=dict[str, Any])


class Camera(Protocol):
    """Source of frames, read by one thread."""

    def read(self) -> Frame:
        """Wait for the next frame.

        Raises:
            RobotError: If the camera stopped or its data is not a valid frame.
        """
        ...

    def close(self) -> None:
        """Close the camera; a `read` that waits in another thread raises an error."""
        ...


def open_camera(plan: CameraPlan) -> Camera:
    """Open a camera."""
    return load(CAMERA_DRIVERS[plan.driver])(plan)


class Interruption:
    """Wait for a file descriptor, interruptible from any thread."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        self._is_set = False

    def wait(self, fd: int, at_most_s: float | None = None) -> bool:
        """Wait until a descriptor is readable.

        Returns:
            Whether it is; False after `at_most_s` seconds.
        """
        poll = select.poll()
        poll.register(fd, select.POLLIN)
        poll.register(self._read, select.POLLIN)
        ready = poll.poll(None if at_most_s is None else at_most_s * 1e3)
        if self._is_set:
            raise RobotError("The camera is closed.")
        return bool(ready)

    def set(self) -> None:
        """Interrupt all waits, now and in the future."""
        if not self._is_set:
            self._is_set = True
            os.write(self._write, b"\0")

    def __del__(self) -> None:
        # Not in `set`: another thread may still be waiting on them.
        os.close(self._read)
        os.close(self._write)


class Pace:
    """Pacing at a fixed rate.

    Args:
        fps: Frames per second.
    """

    def __init__(self, fps: float) -> None:
        self._period_ns = round(1e9 / fps)
        self._next_ns = time.monotonic_ns()
        self._closed = threading.Event()

    def wait(self) -> int:
        """Wait until the next frame is due, and return that time: monotonic, ns.

        A late frame is due at once, and the rate continues from there.
        """
        left_ns = self._next_ns - time.monotonic_ns()
        if self._closed.wait(max(0.0, left_ns / 1e9)):
            raise RobotError("The camera is closed.")
        now_ns = time.monotonic_ns()
        self._next_ns = max(self._next_ns, now_ns - self._period_ns) + self._period_ns
        return now_ns

    def close(self) -> None:
        """Interrupt all waits, now and in the future."""
        self._closed.set()
