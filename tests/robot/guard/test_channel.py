"""The guard's end of the daemon socket detects the loss of the daemon."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator

import pytest

from shapechanger.robot.guard.channel import DaemonChannel
from shapechanger.robot.guard.messages import Order, encode


@pytest.fixture
def ends() -> Iterator[tuple[DaemonChannel, socket.socket]]:
    """The guard's channel and the daemon's socket."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    channel = DaemonChannel(ours.detach())
    yield channel, theirs
    channel.close()
    theirs.close()


def test_a_closed_socket_means_a_lost_daemon(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    daemon.send(encode(Order(kind="halt")))
    daemon.close()
    assert [order.kind for order in channel.orders()[0]] == ["halt"]
    assert channel.lost


def test_a_closed_life_pipe_means_a_lost_daemon(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    watched, held = os.pipe()
    assert len(channel.filenos()) == 1
    socket.send_fds(daemon, [b"life"], [watched])
    os.close(watched)
    assert channel.orders() == ([], [])
    assert not channel.lost
    assert len(channel.filenos()) == 2
    os.close(held)
    assert channel.orders() == ([], [])
    assert channel.lost


def test_a_second_life_pipe_is_closed(ends: tuple[DaemonChannel, socket.socket]) -> None:
    channel, daemon = ends
    pipes = [os.pipe() for _ in range(2)]
    for watched, _ in pipes:
        socket.send_fds(daemon, [b"life"], [watched])
        os.close(watched)
    assert channel.orders() == ([], [])
    with pytest.raises(BrokenPipeError):
        os.write(pipes[1][1], b"x")
    os.write(pipes[0][1], b"x")  # The first pipe is still open.
    for _, held in pipes:
        os.close(held)
