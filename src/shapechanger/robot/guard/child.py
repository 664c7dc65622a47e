"""A process that the supervisor has started, with its heartbeat."""

from __future__ import annotations

import os
import socket
import subprocess
from collections.abc import Sequence

__all__ = ["Child"]


class Child:
    """Starts a process, listens to its heart, and ends it.

    The process gets one end of a pair of sockets as `--heartbeat-fd`. When the supervisor dies,
    however it dies, the kernel closes the other end, and the process ends itself. This is why there
    is no PR_SET_PDEATHSIG here: a signal would kill the guard in the middle of whatever its pins
    do, where the end of the stream lets it put them to rest.

    Attributes:
        name: What it is.
        beaten_ns: When its heart was heard last; when it was started, before the first beat.
        has_beaten: Whether it was heard at all.
        killed: Whether it was ended by `kill`; one that is stuck in the kernel outlives that.

    Args:
        name: What it is.
        command: What to run; `--heartbeat-fd N` is added.
        inherited: Descriptors that it inherits.
        now_ns: The time.
    """

    def __init__(
        self, name: str, command: Sequence[str], inherited: Sequence[int], now_ns: int
    ) -> None:
        self.name = name
        self.beaten_ns = now_ns
        self.has_beaten = False
        self.killed = False
        self._heart, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        self._heart.setblocking(False)
        with theirs:
            self._process = subprocess.Popen(
                [*command, "--heartbeat-fd", str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=[*inherited, theirs.fileno()],
                # A key press such as Ctrl-C is for the supervisor, which ends them in order.
                process_group=0,
            )
        # Tells of the end at once. The heartbeat's end tells it too, but not of a process whose own
        # children hold the socket.
        can_watch = hasattr(os, "pidfd_open")
        self._pidfd = os.pidfd_open(self._process.pid) if can_watch else None

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    @property
    def code(self) -> int | None:
        """Its exit code, negative for a signal; None while it runs."""
        return self._process.returncode

    def descriptors(self) -> list[int]:
        """What can be read when it says something or ends."""
        return [self._heart.fileno(), *([] if self._pidfd is None else [self._pidfd])]

    def is_gone(self, now_ns: int) -> bool:
        """Listen to its heart, and say whether it has ended."""
        try:
            while beats := self._heart.recv(4096):
                self.has_beaten, self.beaten_ns = True, now_ns
                if len(beats) < 4096:
                    break
            is_closed = not beats
        except BlockingIOError:
            is_closed = False
        except ConnectionResetError:
            is_closed = True
        return self._process.poll() is not None or is_closed

    def has_ended(self) -> bool:
        """Whether there is no such process any more."""
        return self._process.poll() is not None

    def kill(self, at_most_s: float) -> None:
        """End it at once (SIGKILL), and wait for its end so long at most."""
        self.killed = True
        self._process.kill()
        self._wait(at_most_s)

    def tell(self) -> None:
        """Tell it to end (SIGTERM)."""
        if not self.has_ended():
            self._process.terminate()

    def end(self, at_most_s: float, reap_s: float) -> None:
        """Tell it to end, and end it at once if it has not ended by then.

        Args:
            at_most_s: How long it may take.
            reap_s: How long it may take to be gone after it was killed.
        """
        self.tell()
        if not self._wait(at_most_s):
            self.kill(reap_s)

    def close(self) -> None:
        """Let go of it; it must have ended."""
        self._heart.close()
        if self._pidfd is not None:
            os.close(self._pidfd)
            self._pidfd = None

    def _wait(self, at_most_s: float) -> bool:
        try:
            self._process.wait(at_most_s)
        except subprocess.TimeoutExpired:  # Stuck in the kernel, or deaf.
            return False
        return True
