"""The real guard process on the twin's pins and clock, checked by the oracle."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from shapechanger.robot.guard.channel import Order, encode
from shapechanger.robot.twin.judge import propelled, time_to_rest, unauthorised
from shapechanger.robot.twin.robot import Operator
from shapechanger.robot.twin.signals import read_ledger
from shapechanger.robot.twin.start import start_board
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.robots import CAR, guard_process, until

pytestmark = pytest.mark.realtime

_DEADLINE_MS = 250


def test_a_guard_drives_and_stops_at_the_deadline(tmp_path: Path) -> None:
    """Twenty commands drive the car; after the last it stops exactly at the deadline."""
    with (
        start_board(CAR, "twin", tmp_path, seed=1) as board,
        Operator(board.socket_path) as operator,
        guard_process(CAR, board) as (_, daemon),
    ):
        # The guard's first message shows that it has joined the clock.
        until(lambda: operator.advance(0.01) > 0 and _received(daemon))
        now_ns = operator.advance(0.02)
        daemon.send(encode(Order("arm", session=1, issued_ns=now_ns)))
        now_ns = operator.advance(0.02)
        commands: list[int] = []
        for seq in range(1, 21):
            values = (-0.5, 0.6)
            order = Order("command", 1, seq, issued_ns=now_ns, ttl_ms=1000, values=values)
            daemon.send(encode(order))
            commands.append(now_ns)
            now_ns = operator.advance(0.05)
            while _received(daemon):
                pass
        driven = operator.where()
        operator.advance(1.0)
        ledger = read_ledger(board.ledger_path)
    wiring = TwinWiring(CAR)
    assert driven.travelled_m > 0.3
    assert driven.speed > 0.5
    assert [interval.value for interval in propelled(ledger, wiring)] == [0.6]
    for short_ms, obeyed in ((0, True), (1, False)):
        permitted = [(at_ns, at_ns + (_DEADLINE_MS - short_ms) * 1e6) for at_ns in commands]
        assert (unauthorised(ledger, wiring, permitted) == []) == obeyed
    assert time_to_rest(ledger, wiring, commands[-1]) == pytest.approx(0.25, abs=1e-9)


def _received(daemon: socket.socket) -> bool:
    try:
        return bool(daemon.recv(65536))
    except BlockingIOError:
        return False
