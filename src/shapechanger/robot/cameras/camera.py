"""Camera interface, frames, and the kinds of cameras."""

from __future__ import annotations

import os
import select
import time
from dataclasses import dataclass, field
from typing import Annotated, Any, Final, NamedTuple

from msgspec import Meta

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import FilePath, Keys
from shapechanger.robot.hardware import load


class _NumberKeys(Keys, frozen=True, kw_only=True):
    """Keys of a camera on the ribbon cable.

    Attributes:
        number: Number of the camera.
    """

    number: Annotated[int, Meta(ge=0, le=9)] = 0


class _DeviceKeys(Keys, frozen=True, kw_only=True):
    """Keys of a webcam.

    Attributes:
        device: Device of the camera.
    """

    device: FilePath = "/dev/video0"


class _PathKeys(Keys, frozen=True, kw_only=True):
    """Keys of a folder of JPEG files, or of a JPEG stream.

    Attributes:
        path: The folder; or the source of the stream: a pipe, a file or "| program arguments".
    """

    path: FilePath


class CameraKind(NamedTuple):
    """A kind of camera."""

    # Keys of its settings in a profile, in addition to the keys that all cameras have.
    keys: type[Keys]
    opens: str  # MODULE:NAME of its driver, which is called with the camera's plan.


CAMERAS: Final = {
    "picamera2": CameraKind(_NumberKeys, "shapechanger.robot.cameras.picamera2:PiCamera"),
    "v4l2": CameraKind(_DeviceKeys, "shapechanger.robot.cameras.v4l2:V4l2"),
    "file": CameraKind(_PathKeys, "shapechanger.robot.cameras.sources:Folder"),
    "pipe": CameraKind(_PathKeys, "shapechanger.robot.cameras.sources:Pipe"),
    "pattern": CameraKind(Keys, "shapechanger.robot.cameras.sources:Pattern"),
}
"""Kinds of cameras, keyed by driver."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame."""

    jpeg: bytes  # The image as JPEG.
    captured_ns: int  # Time of capture on the robot's monotonic clock, ns.
    # Whether this process has encoded the JPEG from an image of the right size, so that the frame
    # needs no further check.
    encoded_here: bool = False
    # Number of bytes between the previous frame and this one that belong to no frame.
    skipped: int = 0


_Side = Annotated[int, Meta(ge=16, le=1920, multiple_of=2)]
_Size = Annotated[
    tuple[_Side, _Side],
    Meta(description="[width, height] in pixels, each an even number from 16 to 1920"),
]


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
    size: _Size = (160, 120)
    fps: Annotated[float, Meta(ge=1, le=120)] = 20.0
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 80
    flip: bool = False
    pitch_deg: Annotated[float, Meta(ge=-45, le=45)] | None = None
    fovy_deg: Annotated[float, Meta(ge=10, le=170)] | None = None
    settings: dict[str, Any] = field(default_factory=dict[str, Any])


class Camera:
    """Source of frames. One thread may call `read`; any thread may `close`."""

    def __init__(self, plan: CameraPlan) -> None:
        self.plan = plan
        self._woken, self._wake = os.pipe()
        self._closed = False
        self._next_ns = time.monotonic_ns()

    def read(self) -> Frame:
        """Wait for the next frame; raise RobotError if the camera stops or its data is invalid."""
        raise NotImplementedError

    def wait(self, fd: int | None = None, at_most_s: float | None = None) -> bool:
        """Return True once `fd` is readable, or False after `at_most_s` s; raise if closed."""
        poll = select.poll()
        for one in (self._woken,) if fd is None else (self._woken, fd):
            poll.register(one, select.POLLIN)
        ready = poll.poll(None if at_most_s is None else at_most_s * 1e3)
        if self._closed:
            raise RobotError("The camera is closed.")
        return bool(ready)

    def pace(self) -> int:
        """Wait until the next frame is due at the plan's rate; return the time then: monotonic, ns.

        A late frame is due at once. After a frame that is more than a period late, the schedule
        starts again.
        """
        period_ns = round(1e9 / self.plan.fps)
        self.wait(at_most_s=max(0, self._next_ns - time.monotonic_ns()) / 1e9)
        now_ns = time.monotonic_ns()
        self._next_ns = max(self._next_ns, now_ns - period_ns) + period_ns
        return now_ns

    def close(self) -> None:
        """Close the camera; a `wait` in another thread raises an error."""
        if not self._closed:
            self._closed = True
            os.write(self._wake, b"\0")

    def __del__(self) -> None:
        # Not in `close`: another thread may still be waiting on these descriptors.
        os.close(self._woken)
        os.close(self._wake)


def open_camera(plan: CameraPlan) -> Camera:
    """Open a camera."""
    return load(CAMERAS[plan.driver].opens)(plan)
