"""Camera driver for the Raspberry Pi's camera over picamera2, a system package.

Tested against a recording fake only, not on a camera. Sources: picamera2's code and manual (The
Picamera2 Library, sections 4 and 6).
"""

from __future__ import annotations

import threading
from typing import Any, Final

import numpy as np
import simplejpeg

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame

_SILENT_S: Final = 2.0  # Some camera stacks stop silently (picamera2#1004).

# The name describes a word in memory: "BGR888" is red, green, blue in byte order.
_FORMAT: Final = "BGR888"


class PiCamera:
    """Camera on the Pi's own connector; see `Camera`. Its setting is its `number`, from 0.

    Raises:
        RobotError: If picamera2 is not installed, or there is no such camera.
    """

    def __init__(self, plan: CameraPlan) -> None:
        try:
            from libcamera import Transform  # pyright: ignore[reportMissingModuleSource]
            from picamera2 import Picamera2  # pyright: ignore[reportMissingModuleSource]
        except ImportError as error:
            raise RobotError(
                "The Pi's camera needs picamera2: `sudo apt install python3-picamera2`, and a "
                "virtual environment made with `python3 -m venv --system-site-packages` by the "
                "system's Python."
            ) from error
        self._plan = plan
        self._lock = threading.Lock()  # `close` waits for a `read` in progress.
        self._closed = False
        try:
            self._camera: Any = Picamera2(plan.settings["number"])
        except (RuntimeError, IndexError) as error:
            raise RobotError(
                f"There is no camera {plan.settings['number']}: {error}. "
                "`rpicam-hello --list-cameras` lists what the system sees."
            ) from error
        period_us = round(1e6 / plan.fps)
        try:
            self._camera.configure(
                self._camera.create_video_configuration(
                    main={"size": plan.size, "format": _FORMAT},
                    transform=Transform(hflip=int(plan.flip), vflip=int(plan.flip)),
                    # Never a frame from before the call (picamera2#787).
                    queue=False,
                    controls={"FrameDurationLimits": (period_us, period_us)},
                )
            )
            self._camera.start()
        except RuntimeError as error:
            self._camera.close()
            raise RobotError(f"The Pi's camera does not start: {error}.") from error

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        with self._lock:
            if self._closed:
                raise RobotError("The camera is closed.")
            try:
                request = self._camera.capture_request(wait=_SILENT_S)
            except (TimeoutError, RuntimeError) as error:
                raise RobotError(
                    f"The Pi's camera has sent no frame for {_SILENT_S:g} s: check its cable."
                ) from error
            try:
                image = np.ascontiguousarray(request.make_array("main"))
                # SensorTimestamp: nanoseconds of the monotonic clock at the first line's exposure.
                captured_ns = int(request.get_metadata()["SensorTimestamp"])
            finally:
                request.release()
        width, height = self._plan.size
        if image.shape != (height, width, 3):
            raise RobotError(
                f"The Pi's camera returned a frame of {image.shape[1]} by {image.shape[0]} pixels; "
                f"the profile sets {width} by {height}."
            )
        quality = self._plan.jpeg_quality
        jpeg = simplejpeg.encode_jpeg(image, quality, colorsubsampling="420")
        return Frame(jpeg, captured_ns, encoded_here=True)

    def close(self) -> None:
        """Stop the camera after a `read` in progress."""
        with self._lock:
            if not self._closed:
                self._closed = True
                self._camera.stop()
                self._camera.close()
