"""The client against the real daemon, with a fake guard and camera."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from shapechanger.demos.episodes import read_episode
from shapechanger.errors import LinkError, RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.link.messages import Judge, Recordings
from tests.robot.client.robot import STATE, eventually
from tests.robot.daemon.plans import car_plan
from tests.robot.daemon.running import Running, running

pytestmark = pytest.mark.realtime

HZ = 20.0
SENSED = {"speed": 0.5, "collision": 0.0, "stall": 0.0, "battery": 7.4}


class Served:
    """A daemon in its own thread; `running` may only be changed on its event loop."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, **plan: Any) -> None:
        made = make_credentials(folder, "test car")
        self.known_at = made.fingerprint.hex()
        self.key = made.key
        self._plan = car_plan(
            credentials=str(folder), state_layout=Layout(STATE).to_json(), control_hz=HZ, **plan
        )
        self._monkeypatch = monkeypatch
        self._ready = threading.Event()

    @contextlib.contextmanager
    def serving(self) -> Iterator[Served]:
        thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        thread.start()
        assert self._ready.wait(20.0)
        try:
            yield self
        finally:
            self._loop.call_soon_threadsafe(self._stop.set)
            thread.join()

    @property
    def known(self) -> KnownRobot:
        return KnownRobot("test", f"127.0.0.1:{self.running.port}", self.key, self.known_at)

    def sense(self, **quantities: float) -> None:
        sensed = SENSED | quantities
        state = {"quantities": sensed, "sources": dict.fromkeys(sensed, "wheel")}
        self._loop.call_soon_threadsafe(lambda: self.running.guard.send(**state))

    async def _serve(self) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        async with running(self._plan, self._monkeypatch) as robot:
            self.running: Running = robot
            self._ready.set()
            while not self._stop.is_set():
                robot.show()
                robot.guard.send()
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(1.0 / HZ):
                        await self._stop.wait()


@pytest.fixture
def serve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Served]]:
    with contextlib.ExitStack() as stack:

        def made(**plan: Any) -> Served:
            robot = stack.enter_context(Served(tmp_path, monkeypatch, **plan).serving())
            robot.sense()
            return robot

        yield made


def test_arming_works_after_a_long_silence(serve: Callable[..., Served]) -> None:
    robot = serve(max_observation_age_ms=100)
    with RobotClient.connect(robot.known, role="person") as person:
        person.take()
        seen = person.ask().message
        eventually(lambda: robot.running.clock.now_ns() - seen.sent_ns > 200_000_000)
        person.arm()
        assert robot.running.guard.state.armed


@pytest.fixture
def recorder(tmp_path: Path, serve: Callable[..., Served]) -> Served:
    return serve(recordings=str(tmp_path / "kept"), deadline_ms=60_000)


def test_a_person_records_marks_and_undoes(recorder: Served, tmp_path: Path) -> None:
    with RobotClient.connect(recorder.known, role="person", name="Ada") as client:
        assert client.welcome.can_record
        assert client.recorder is None
        client.take()
        client.arm()
        seen = client.ask()

        def drive(steps: int) -> None:
            nonlocal seen
            for _ in range(steps):
                seen = client.exchange((0.0, 0.5), seen)

        began = client.record(name="corridor")
        assert (began.recording, began.steps) == (True, 0)
        drive(6)
        assert client.mark("here").marks == 1
        assert client.undo(3_600.0).dropped == 6
        with pytest.raises(RobotRefused, match="nothing to undo"):
            client.undo()
        with pytest.raises(LinkError, match="Not a valid message"):
            client.fetch("../../etc")
        assert client.alive
        drive(2)
        ended = client.record(on=False)
        assert (ended.recording, ended.steps, ended.dropped) == (False, 8, 6)
        assert client.recorder == ended
        (summary,) = client.browse().episodes
        assert (summary.id, summary.steps, summary.kept) == (ended.episode, 8, 2)
        judge = Judge(episode=summary.id, first=0, last=5, keep=True)
        assert client._ask(judge, Recordings).episodes[0].kept == 8
        piece = client.fetch(summary.id)
        path = tmp_path / "kept" / summary.id
        assert "".join(f"{line}\n" for line in piece.lines) == (path / "steps.jsonl").read_text()
        assert client.fetch(summary.id, first=piece.total).lines == ()
    assert len(read_episode(path).kept) == 8
