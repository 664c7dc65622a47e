"""Who moves the board's time: the machine's clock, or those who ask for time on the twin's."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final, NamedTuple

from shapechanger.errors import RobotError
from shapechanger.twin.camera import FrontCameraPipe
from shapechanger.twin.server import BoardConnection, Switchboard

__all__ = ["START_NS", "MachineTime", "TwinTime"]

START_NS: Final = 1_000_000_000
"""Where the twin's clock starts; not at 0, which could be taken for "never"."""

_WORLD_STEP_NS: Final = 10_000_000

# How often to look for a reader of the pictures while time stands still.
_LOOK_FOR_READER_S: Final = 0.05


class _Sleeper(NamedTuple):
    """Somebody who asked for time.

    Attributes:
        until_ns: How long it sleeps.
        number: How many came before it.
        connection: Who it is.
        question: What its answer belongs to.
    """

    until_ns: int
    number: int
    connection: BoardConnection
    question: int


class MachineTime:
    """The world goes on with CLOCK_MONOTONIC, in steps of 10 ms."""

    def __init__(self) -> None:
        self.clock = "real"

    def now_ns(self) -> int:
        """The time."""
        return time.monotonic_ns()

    def sleep(self, connection: BoardConnection, question: int, ns: int) -> None:
        """Nobody can ask for time here."""
        raise RobotError("This board runs in real time, which goes by itself.")

    def wait(self, connection: BoardConnection, until_ns: int) -> None:
        """Nobody is granted time here."""
        raise RobotError("This board runs in real time, which nobody is granted.")

    def run(
        self,
        switchboard: Switchboard,
        camera: FrontCameraPipe | None,
        go_on: Callable[[int], None],
        take: Callable[[int], None],
    ) -> None:
        """Run until the owner is gone."""
        step_ns = self.now_ns()
        while True:
            due_ns = step_ns if camera is None else min(step_ns, camera.next_ns)
            switchboard.pump(max(0, due_ns - self.now_ns()) / 1e9)
            now_ns = self.now_ns()
            if now_ns >= due_ns:
                go_on(now_ns)
                step_ns = now_ns + _WORLD_STEP_NS if now_ns >= step_ns else step_ns
                if camera is not None and now_ns >= camera.next_ns:
                    take(now_ns)


class TwinTime:
    """Time goes on only while somebody sleeps, and waits for all who take part.

    Args:
        tick_hz: How often those who take part are granted time at least.
    """

    def __init__(self, tick_hz: float) -> None:
        self.clock = "twin"
        self._tick_hz = tick_hz
        self._now_ns = START_NS
        self._ticks = 0
        self._sleepers: list[_Sleeper] = []
        self._asked = 0

    def now_ns(self) -> int:
        """The time."""
        return self._now_ns

    def sleep(self, connection: BoardConnection, question: int, ns: int) -> None:
        """Somebody asks for time."""
        self._asked += 1
        self._sleepers.append(_Sleeper(self._now_ns + ns, self._asked, connection, question))

    def wait(self, connection: BoardConnection, until_ns: int) -> None:
        """Somebody takes part, and is done with what was granted."""
        connection.takes_part = True
        connection.works = False
        connection.until_ns = until_ns

    def run(
        self,
        switchboard: Switchboard,
        camera: FrontCameraPipe | None,
        go_on: Callable[[int], None],
        take: Callable[[int], None],
    ) -> None:
        """Run until the owner is gone."""
        while True:
            if self._sleepers:
                switchboard.pump(0.0)
            else:
                found = camera is None or camera.find_reader()
                switchboard.pump(None if found else _LOOK_FOR_READER_S)
            # Who has left does not sleep any more.
            self._sleepers = [one for one in self._sleepers if one.connection.fileno() >= 0]
            if not self._sleepers:
                continue
            end = min(self._sleepers)
            if end.until_ns > self._now_ns:
                self._step(end.until_ns, switchboard, camera, go_on, take)
            if end.until_ns <= self._now_ns:
                self._sleepers.remove(end)
                newest_ns = None if camera is None else camera.newest_ns
                switchboard.send(
                    end.connection,
                    {
                        "op": "reply",
                        "id": end.question,
                        "t": self._now_ns,
                        "captured_ns": newest_ns,
                    },
                )

    def _step(
        self,
        end_ns: int,
        switchboard: Switchboard,
        camera: FrontCameraPipe | None,
        go_on: Callable[[int], None],
        take: Callable[[int], None],
    ) -> None:
        """Go on to the next time at which anything happens."""
        taking_part = [one for one in switchboard.connections if one.takes_part]
        tick_ns = self._next_tick_ns()
        wanted = [one.until_ns for one in taking_part if one.until_ns > self._now_ns]
        grant_ns = min(end_ns, tick_ns, *wanted)
        picture_ns = grant_ns if camera is None else max(camera.next_ns, self._now_ns)
        self._now_ns = min(grant_ns, picture_ns)
        go_on(self._now_ns)
        if camera is not None and camera.next_ns <= self._now_ns:
            take(self._now_ns)
        if self._now_ns < grant_ns:
            return
        for connection in taking_part:
            connection.works = True
            switchboard.send(connection, {"op": "grant", "t": self._now_ns})
        while any(one.works and one.fileno() >= 0 for one in taking_part):
            switchboard.pump(None)

    def _next_tick_ns(self) -> int:
        while (tick_ns := START_NS + round(self._ticks * 1e9 / self._tick_hz)) <= self._now_ns:
            self._ticks += 1
        return tick_ns
