"""Camera thread of the daemon, which passes on only valid, new frames."""

from collections.abc import Iterator

import pytest

from shapechanger.robot.cameras.camera import CameraPlan, Frame
from shapechanger.robot.daemon import camera as daemon_camera
from shapechanger.robot.daemon.camera import FrameChecks, FrameReader
from tests.robot.daemon.fakes import FakeCamera
from tests.robot.daemon.plans import SIZE, picture
from tests.robot.twin.robots import until

NOW_NS = 10_000_000_000


class Watched:
    """A reader of a fake camera, with the frames and reports that it delivered."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []
        self.reports: list[str] = []
        plan = CameraPlan("pattern", SIZE, fps=500.0)
        checks = FrameChecks(lambda: NOW_NS)
        self.reader = FrameReader(plan, checks, self.frames.append, self.reports.append)


@pytest.fixture
def camera() -> FakeCamera:
    return FakeCamera()


@pytest.fixture
def watched(camera: FakeCamera, monkeypatch: pytest.MonkeyPatch) -> Iterator[Watched]:
    monkeypatch.setattr(daemon_camera, "open_camera", camera.open)
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
        (GOOD, 1, "not newer than the one before"),
        (GOOD, NOW_NS + 60_000_000, "from the future"),
    ],
)
def test_invalid_frames_are_rejected(jpeg: bytes, captured_ns: int, text: str) -> None:
    checks = FrameChecks(lambda: NOW_NS)
    assert checks.refusal(Frame(picture(1), 1)) == ""
    assert text in checks.refusal(Frame(jpeg, captured_ns))
    assert checks.refusal(Frame(picture(4), 3)) == ""


def test_a_failing_camera_is_reported_once_and_reopened(
    camera: FakeCamera, watched: Watched
) -> None:
    for at in range(1, 6):
        camera.put(Frame(picture(1), at))
    for at in range(6, 16):
        camera.put(Frame(b"garbage", at))
    camera.put(Frame(picture(2), 100))
    camera.fail("The camera was unplugged.")
    camera.put(Frame(picture(3), 101))
    until(lambda: len(watched.reports) == 5, 20.0)
    assert [frame.captured_ns for frame in watched.frames] == [1, 100, 101]
    assert camera.opened == 3
    texts = ("same frame", "decoded", "works again", "was unplugged", "works again")
    for report, text in zip(watched.reports, texts, strict=True):
        assert text in report


def test_closing_ends_a_camera_without_frames(watched: Watched) -> None:
    watched.reader.close()
    assert not watched.reader._thread.is_alive()
    assert watched.reports == []
