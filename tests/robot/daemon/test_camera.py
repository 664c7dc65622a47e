"""Camera thread of the daemon: only valid, new frames are passed on."""

import threading
from collections.abc import Callable, Iterator

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.daemon import camera as daemon_camera
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader
from tests.robot.daemon.fakes import FakeCamera
from tests.robot.daemon.plans import SIZE, picture

NOW_NS = 10_000_000_000


class Watched:
    """A reader of a fake camera, with the frames and reports that it delivered."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.reports: list[str] = []
        self._changed = threading.Condition()
        checks = FrameChecks(lambda: NOW_NS)
        plan = CameraPlan("pattern", SIZE, fps=500.0)
        self.reader = FrameReader(plan, checks, self._frame, self._report)

    def until(self, condition: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(condition, 20.0), (self.frames, self.reports)

    def _frame(self, frame: Frame) -> None:
        with self._changed:
            self.frames.append(frame)
            self._changed.notify()

    def _report(self, text: str) -> None:
        with self._changed:
            self.reports.append(text)
            self._changed.notify()


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> FakeCamera:
    camera = FakeCamera()
    monkeypatch.setattr(daemon_camera, "open_camera", lambda plan: camera.open(plan))
    return camera


@pytest.fixture
def watched(camera: FakeCamera) -> Iterator[Watched]:
    """A reader of the fake camera."""
    watched = Watched()
    yield watched
    watched.reader.close()


GOOD = picture(3)


@pytest.mark.parametrize(
    ("jpeg", "captured_ns", "text"),
    [
        (b"", 2, "cannot be decoded"),
        (b"garbage" * 100, 2, "cannot be decoded"),
        (GOOD[: len(GOOD) // 2], 2, "cannot be decoded"),
        (GOOD[: len(GOOD) // 2] + b"\xff\xd9", 2, "cannot be decoded"),
        (picture(1), 2, "same frame"),
        (GOOD, 1, "older than the one before"),
        (GOOD, NOW_NS + 60_000_000, "from the future"),
    ],
)
def test_invalid_frames_are_rejected(jpeg: bytes, captured_ns: int, text: str) -> None:
    checks = FrameChecks(lambda: NOW_NS)
    assert checks.refusal(Frame(picture(1), 1)) == ""
    assert text in checks.refusal(Frame(jpeg, captured_ns))
    assert checks.refusal(Frame(picture(4), 3)) == ""


def test_a_frozen_camera_delivers_nothing_and_is_reported_once(
    camera: FakeCamera, watched: Watched
) -> None:
    for at in range(1, 6):
        camera.put(Frame(picture(1), at))
    camera.put(Frame(picture(2), 6))
    watched.until(lambda: len(watched.reports) == 2)
    assert [frame.captured_ns for frame in watched.frames] == [1, 6]
    assert "same frame" in watched.reports[0]
    assert "again" in watched.reports[1]


def test_a_camera_that_fails_is_opened_again(
    camera: FakeCamera, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcomes = [RobotError("No camera is connected."), camera, camera]

    def open_next(plan: CameraPlan) -> FakeCamera:
        camera.opened += 1
        if isinstance(outcome := outcomes.pop(0), RobotError):
            raise outcome
        return outcome

    monkeypatch.setattr(camera, "open", open_next)
    camera.put(Frame(picture(1), 1))
    camera.fail("The camera was unplugged.")
    camera.put(Frame(picture(2), 2))
    watched = Watched()
    watched.until(lambda: len(watched.frames) == 2 and len(watched.reports) == 4)
    again = "The camera works again."
    assert watched.reports == ["No camera is connected.", again, "The camera was unplugged.", again]
    watched.reader.close()


def test_a_camera_that_sends_only_garbage_is_reopened(camera: FakeCamera, watched: Watched) -> None:
    for at in range(10):
        camera.put(Frame(b"garbage", at))
    camera.put(Frame(picture(1), 100))
    watched.until(lambda: len(watched.frames) == 1)
    assert camera.opened == 2
    assert len([text for text in watched.reports if "cannot be decoded" in text]) == 1


def test_closing_ends_a_camera_without_frames(watched: Watched) -> None:
    watched.reader.close()
    assert not watched.reader._thread.is_alive()
    assert watched.reports == []
