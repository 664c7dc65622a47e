"""The thread that reads the camera, and lets through only pictures that are good and new."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Final, Generic, TypeVar

import simplejpeg

from shapechanger.errors import RobotError, ShapechangerError
from shapechanger.robot.cameras.camera import Camera, CameraPlan, Frame, open_camera
from shapechanger.robot.cameras.jpeg import FreezeDetector, check_jpeg

__all__ = ["FrameChecks", "FrameReader", "Latest"]

_FUTURE_NS: Final = 50_000_000  # Two clocks that are one may still be read in another order.
_FIRST_PAUSE_S: Final = 0.1
_LONGEST_PAUSE_S: Final = 2.0
_BAD_UNTIL_REOPENED: Final = 10
_JOIN_S: Final = 2.0


class FrameChecks:
    """Says whether a picture may count as what the robot sees now.

    Args:
        size: Width and height that it must have.
        now_ns: Gives the robot's time, to refuse pictures from the future; None where time moves
            in steps, so that a picture may come before its time is known here.
    """

    def __init__(self, size: tuple[int, int], now_ns: Callable[[], int] | None = None) -> None:
        self._size = size
        self._now_ns = now_ns
        self._freeze = FreezeDetector()
        self._newest_ns = -1

    def refusal(self, frame: Frame) -> str:
        """Why a picture does not count, in words; empty if it does."""
        try:
            check_jpeg(frame.jpeg, self._size)
            # Down to the last block: strict refuses what a decoder would fill up with grey.
            simplejpeg.decode_jpeg(frame.jpeg, colorspace="GRAY", fastdct=True, strict=True)
        except (RobotError, ValueError) as error:
            return str(error)
        if not self._freeze.is_new(frame.jpeg):
            return "The camera gives the same picture again and again."
        if frame.captured_ns <= self._newest_ns:
            return "The camera gave a picture that is older than the one before."
        if self._now_ns is not None and frame.captured_ns > self._now_ns() + _FUTURE_NS:
            return "The camera gave a picture from the future."
        self._newest_ns = frame.captured_ns
        return ""


class FrameReader:
    """Reads a camera in a thread of its own, and opens it again when it fails.

    Args:
        plan: The camera.
        checks: What a picture must pass.
        deliver: Called with each good and new picture, in the thread.
        report: Called in the thread with a sentence when something is wrong, and when it is well
            again; the same sentence is said once.
        opener: Opens the camera.
    """

    def __init__(
        self,
        plan: CameraPlan,
        checks: FrameChecks,
        deliver: Callable[[Frame], None],
        report: Callable[[str], None],
        opener: Callable[[CameraPlan], Camera] = open_camera,
    ) -> None:
        self.errors = 0
        """How many pictures or attempts failed."""
        self._plan = plan
        self._checks = checks
        self._deliver = deliver
        self._report = report
        self._open = opener
        self._trouble = ""
        self._end = threading.Event()
        self._camera: Camera | None = None
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """End the thread, and let go of the camera."""
        self._end.set()
        camera = self._camera
        if camera is not None:
            camera.close()
        if self._thread.is_alive():
            self._thread.join(_JOIN_S)

    def _run(self) -> None:
        pause_s = _FIRST_PAUSE_S
        while not self._end.is_set():
            before = self.errors
            try:
                camera = self._open(self._plan)
            except (ShapechangerError, OSError, ImportError) as error:
                self._fail(str(error))
            else:
                self._camera = camera
                try:
                    if self._read(camera):
                        pause_s, before = _FIRST_PAUSE_S, self.errors
                finally:
                    self._camera = None
                    camera.close()
            if self.errors > before:
                pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)
            self._end.wait(pause_s)

    def _read(self, camera: Camera) -> bool:
        """Read until the camera fails; whether there was a good picture."""
        good, bad = False, 0
        while not self._end.is_set() and bad < _BAD_UNTIL_REOPENED:
            try:
                frame = camera.read()
            except (RobotError, OSError, ValueError) as error:
                if not self._end.is_set():
                    self._fail(str(error))
                return good
            refusal = self._checks.refusal(frame)
            if refusal:
                bad += 1
                self._fail(refusal)
                # A broken driver may not wait between pictures, and then this must.
                self._end.wait(0.5 / self._plan.fps)
                continue
            good, bad = True, 0
            self._deliver(frame)
            if self._trouble:
                self._trouble = ""
                self._report("The camera gives pictures again.")
        return good

    def _fail(self, trouble: str) -> None:
        self.errors += 1
        if trouble != self._trouble:
            self._trouble = trouble
            self._report(trouble)


_T = TypeVar("_T")


class Latest(Generic[_T]):
    """Holds the newest thing that was put, until it is taken once.

    A queue plays back what piled up while nobody read; this cannot, since it holds one thing and
    gives it away once. One thread may put and another may take; a race can only lose a thing to a
    newer one.
    """

    __slots__ = ("_slot",)

    def __init__(self) -> None:
        self._slot: list[_T] = []

    def __bool__(self) -> bool:
        """Whether there is something to take."""
        return bool(self._slot)

    def put(self, thing: _T) -> None:
        """Replace what is there."""
        self._slot = [thing]

    def take(self) -> _T | None:
        """The newest thing, which is then gone; None if there is none."""
        slot = self._slot
        try:
            return slot.pop()  # Whoever pops first has it; `put` makes a new list.
        except IndexError:
            return None

    def clear(self) -> None:
        """Throw away what is there."""
        self._slot = []
