"""Camera driver for the Raspberry Pi's camera over picamera2, a system package.

Tested only against a fake that records calls, not on a camera. Sources: picamera2's code and manual
(The Picamera2 Library, sections 4 and 6).
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from typing import Any, Final

from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame
from shapechanger.robot.cameras.jpeg import encoded_frame

_SILENT_S: Final = 2.0  # Longest wait for a frame, s: some cameras stop silently (picamera2#1004).

# The bytes of a pixel in "BGR888" are red, green, blue: the name has the order in a word.
_FORMAT: Final = "BGR888"

_NOT_INSTALLED: Final = (
    "The Pi's camera needs picamera2: `sudo apt install python3-picamera2`, and a virtual "
    "environment made with `python3 -m venv --system-site-packages` by the system's Python."
)


class PiCamera(Camera):
    """Camera on the Pi's own connector; see `Camera`. Its setting is its `number`, from 0."""

    def __init__(self, plan: CameraPlan) -> None:
        super().__init__(plan)
        with translate_errors(ImportError, to=lambda _: RobotError(_NOT_INSTALLED)):
            from libcamera import Transform  # pyright: ignore[reportMissingModuleSource]
            from picamera2 import Picamera2  # pyright: ignore[reportMissingModuleSource]
        self._lock = threading.Lock()  # `close` waits for a `read` in progress.
        number = plan.settings["number"]
        period_us = round(1e6 / plan.fps)
        with (
            translate_errors(
                RuntimeError,
                IndexError,
                to=lambda error: RobotError(
                    f"Camera {number} does not start: {error}. "
                    "`rpicam-hello --list-cameras` lists what the system sees."
                ),
            ),
            ExitStack() as undo,
        ):
            self._camera: Any = Picamera2(number)
            undo.callback(self._camera.close)
            self._camera.configure(
                self._camera.create_video_configuration(
                    main={"size": plan.size, "format": _FORMAT},
                    transform=Transform(hflip=int(plan.flip), vflip=int(plan.flip)),
                    # Do not queue a frame, which would be older than the request (picamera2#787).
                    queue=False,
                    controls={"FrameDurationLimits": (period_us, period_us)},
                )
            )
            self._camera.start()
            undo.pop_all()

    def read(self) -> Frame:
        """Wait for the next frame; see `Camera.read`."""
        with self._lock, ExitStack() as stack:
            self.wait(at_most_s=0.0)  # Raises if it is closed.
            with translate_errors(
                TimeoutError,
                RuntimeError,
                to=lambda _: RobotError(
                    f"The Pi's camera has sent no frame for {_SILENT_S:g} s: check its cable."
                ),
            ):
                request = self._camera.capture_request(wait=_SILENT_S)
            stack.callback(request.release)
            image = request.make_array("main")
            # The monotonic time, ns, at the exposure of the first line.
            captured_ns = int(request.get_metadata()["SensorTimestamp"])
        return encoded_frame(image, captured_ns, self.plan)

    def close(self) -> None:
        """Stop the camera once a `read` in progress has ended."""
        with self._lock:
            if not self._closed:
                super().close()
                self._camera.stop()
                self._camera.close()
