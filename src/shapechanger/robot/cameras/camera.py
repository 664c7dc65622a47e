"""What every camera driver does, and where each is found."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import Final, Protocol

from shapechanger.errors import UnknownName

__all__ = ["CAMERA_DRIVERS", "Camera", "CameraPlan", "Frame", "open_camera"]

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
