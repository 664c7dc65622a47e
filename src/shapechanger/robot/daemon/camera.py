"""Camera thread of the daemon, which passes on only valid, new frames."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import closing
from typing import Final

import simplejpeg

from shapechanger.errors import ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame, open_camera

_FUTURE_NS: Final = 50_000_000  # Tolerance, because two readings of a clock may be reordered.
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 2.0
_BAD_UNTIL_REOPENED: Final = 10
_JOIN_S: Final = 2.0


class FrameChecks:
    """Rejects frames that fail to decode, repeat the last one or have an impossible time.

    `now_ns` is None if time moves in steps: a frame may then arrive before its time is known.
    """

    def __init__(self, now_ns: Callable[[], int] | None = None) -> None:
        self._now_ns = now_ns
        self._last = b""
        self._newest_ns = -1

    def refusal(self, frame: Frame) -> str:
        """Return the reason to reject a frame, or "" if it is valid and new."""
        if not frame.encoded_here:
            try:
                # The driver has checked the header. `strict` rejects missing data; otherwise the
                # decoder would fill it with grey.
                simplejpeg.decode_jpeg(frame.jpeg, colorspace="GRAY", fastdct=True, strict=True)
            except ValueError as error:
                return f"The camera sent a JPEG that cannot be decoded: {error}."
        # Sensor noise makes frames differ, so the same bytes are never a new frame.
        if frame.jpeg == self._last:
            return "The camera repeats the same frame."
        self._last = frame.jpeg
        if frame.captured_ns <= self._newest_ns:
            return "The camera sent a frame that is not newer than the one before."
        if self._now_ns is not None and frame.captured_ns > self._now_ns() + _FUTURE_NS:
            return "The camera sent a frame from the future."
        self._newest_ns = frame.captured_ns
        return ""


class FrameReader:
    """Reads a camera in a thread until `close`, and reopens it after failures."""

    def __init__(
        self,
        plan: CameraPlan,
        checks: FrameChecks,
        deliver: Callable[[Frame], None],
        report: Callable[[str], None],
    ) -> None:
        self._plan = plan
        self._checks = checks
        self._deliver = deliver
        self._report = report
        self._trouble = ""
        self._skips = False
        self._end = threading.Event()
        self._camera: Camera | None = None
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End the thread, and close the camera."""
        self._end.set()
        camera = self._camera
        if camera is not None:
            camera.close()
        self._thread.join(_JOIN_S)

    def _run(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while not self._end.is_set():
            works = self._read()
            pause_s = _FIRST_PAUSE_S if works else min(2 * pause_s, _LONGEST_PAUSE_S)
            self._end.wait(pause_s)

    def _read(self) -> bool:
        """Open the camera and read it until it fails. Return True if there was a valid frame."""
        good, bad = False, 0
        try:
            with closing(open_camera(self._plan)) as camera:
                self._camera = camera
                while not self._end.is_set() and bad < _BAD_UNTIL_REOPENED:
                    frame = camera.read()
                    if refusal := self._checks.refusal(frame):
                        bad += 1
                        self._fail(refusal)
                        # A broken driver may return without waiting for the next frame.
                        self._end.wait(0.5 / self._plan.fps)
                        continue
                    good, bad = True, 0
                    self._deliver(frame)
                    if frame.skipped and not self._skips:
                        self._skips = True  # Some streams have bytes between all frames.
                        self._report(
                            f"The camera's stream has bytes between its JPEG frames, "
                            f"{frame.skipped} before this frame: they are skipped."
                        )
                    if self._trouble:
                        self._trouble = ""
                        self._report("The camera works again.")
        except (ShapechangerError, OSError, ImportError, ValueError) as error:
            if not self._end.is_set():
                self._fail(str(error))
        return good

    def _fail(self, trouble: str) -> None:
        if trouble != self._trouble:
            self._trouble = trouble
            self._report(trouble)
