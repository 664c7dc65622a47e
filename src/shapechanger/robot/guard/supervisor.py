"""Supervisor: starts the guard and the daemon, and makes the outputs safe if either fails.

It is the parent of both and does nothing else, so that little can fail. A dead or silent guard
cannot put the outputs to rest, and a Raspberry Pi keeps the levels of its pins; the supervisor then
kills the guard and puts them to rest, retrying until they obey. It then restarts both processes,
unless they fail too often; the new guard starts in an emergency stop, which only a person can end.

Exit codes: 0 if asked to end (SIGTERM, SIGINT, SIGHUP, or an order "end" to the guard); 1 if the
processes failed too often; 2 if it cannot start, or after its own error; 3 if, at its end, an
output did not obey or a killed guard did not exit for 5 s. After 0 and 1, the outputs are at rest
or released.
"""

from __future__ import annotations

import contextlib
import logging
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal

from shapechanger.robot.guard.outputs import errors_noted, make_safe, preload
from shapechanger.robot.guard.running import (
    AFTER_FAILURE,
    SUPERVISOR,
    ServePlan,
    command_of,
    descriptors,
    log_to_stderr,
    read_plan_fd,
    run_promptly,
)
from shapechanger.robot.hardware import connect


class Child:
    """A child process with a heartbeat.

    The process gets one end of a pair of sockets as `--heartbeat-fd`. When the supervisor dies for
    any reason, the kernel closes the other end, and the process ends itself: a guard first puts its
    outputs to rest.

    Attributes:
        name: Name of the process.
        beaten_ns: Time of the last heartbeat, or of the start before the first, ns.
        has_beaten: Whether there was a heartbeat.
        killed: Whether SIGKILL was sent; a process stuck in the kernel may still exist.
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
                # Ctrl-C goes to the supervisor, which ends its children in order.
                process_group=0,
            )
        # Becomes readable when the process exits. The heartbeat's socket does too, unless a
        # grandchild has inherited it.
        self._pidfd = os.pidfd_open(self._process.pid)

    @property
    def code(self) -> int | None:
        """Exit code, negative for a signal; None while it runs."""
        return self._process.returncode

    def descriptors(self) -> list[int]:
        """Return the descriptors that become readable when it beats or exits."""
        return [self._heart.fileno(), self._pidfd]

    def is_gone(self, now_ns: int) -> bool:
        """Read its heartbeats; return whether it has exited or closed its end of the stream."""
        beats: bytes | None = None
        try:
            beats = self._heart.recv(1 << 16)
        except BlockingIOError:
            pass  # There was no heartbeat since the last check.
        except ConnectionResetError:
            beats = b""
        if beats:
            self.has_beaten, self.beaten_ns = True, now_ns
        return self.has_ended() or beats == b""

    def has_ended(self) -> bool:
        """Return whether the process has exited."""
        return self._process.poll() is not None

    def kill(self, at_most_s: float) -> None:
        """Send SIGKILL and wait at most `at_most_s` seconds for its exit."""
        self.killed = True
        self._process.kill()
        self._wait(at_most_s)

    def terminate(self) -> None:
        """Send SIGTERM, unless the process has exited."""
        self._process.terminate()

    def end(self, at_most_s: float, reap_s: float) -> None:
        """Send SIGTERM, then SIGKILL if it has not exited in time."""
        self.terminate()
        if not self._wait(at_most_s):
            self.kill(reap_s)

    def close(self) -> None:
        """Close its descriptors."""
        self._heart.close()
        os.close(self._pidfd)

    def _wait(self, at_most_s: float) -> bool:
        with contextlib.suppress(subprocess.TimeoutExpired):  # Stuck in the kernel, or busy.
            self._process.wait(at_most_s)
        return self.has_ended()


_PAUSE_S: Final = 0.2


class Restarts:
    """Limit on recent restarts."""

    def __init__(self, most: int = 5, within_s: float = 60.0) -> None:
        self._most = most
        self._within_ns = round(within_s * 1e9)
        self._times_ns: list[int] = []

    @property
    def pause_s(self) -> float:
        """Delay before the restart that was counted last, s; it grows with each recent restart."""
        return _PAUSE_S * (2 ** (len(self._times_ns) - 1) - 1)

    def may_restart(self, now_ns: int) -> bool:
        """Return whether another restart is permitted now; if so, count it."""
        self._times_ns = [t for t in self._times_ns if now_ns - t < self._within_ns]
        may = len(self._times_ns) < self._most
        if may:
            self._times_ns.append(now_ns)
        return may


_ENDED: Final = 0
_FAILED_TOO_OFTEN: Final = 1
_CANNOT_START: Final = 2
_NOT_SAFE: Final = 3

# Longest wait for the first heartbeat, s: a Pi Zero takes several seconds to load the daemon.
_START_S: Final = 30.0
_END_S: Final = 1.0  # Time to exit after SIGTERM, s; a supervised guard has its silence limit.
_REAP_S: Final = 0.05  # Longest wait for a killed process before the outputs are put to rest, s.
_AGAIN_S: Final = 0.1  # Time between attempts to put the outputs to rest, s.
_UNSAFE_S: Final = 5.0  # Time limit for these if asked to end or no guard ever sent a heartbeat, s.
_CHECK_S: Final = 0.02  # Longest time between checks of the heartbeats, s.
# A longer gap between checks means that the supervisor itself did not run.
_PAUSE_NS: Final = 100_000_000


class Supervisor:
    """Run the processes of one robot."""

    def __init__(self, plan: ServePlan, fd: int, log: logging.Logger) -> None:
        self._plan = plan
        self._fd = fd
        self._log = log
        self._restarts = Restarts()
        self._end_reason = ""
        self._is_safe = True
        self._has_guarded = False
        self._failures: list[str] = []
        # Becomes readable on a signal, to wake the loop.
        self._woken, self._waker = socket.socketpair()
        for end in (self._woken, self._waker):
            end.setblocking(False)

    def run(self) -> int:
        """Run the processes until asked to end, or until giving up; return the exit code."""
        preload(self._plan.guard, self._plan.hardware[0])
        signal.set_wakeup_fd(self._waker.fileno(), warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            if signal.getsignal(number) != signal.SIG_IGN:  # `nohup` ignores SIGHUP.
                signal.signal(number, self._end)
        run_promptly(SUPERVISOR)
        after_failure: tuple[str, ...] = ()
        while True:
            guard, daemon = self._start(after_failure)
            with contextlib.ExitStack() as stopping:
                stopping.callback(self._stop, guard, daemon)
                why = self._supervise(guard, daemon)
            if not self._end_reason:
                if not self._is_safe:
                    self._log.critical("gives up: %s, and not all outputs are at rest.", why)
                    return _NOT_SAFE
                if not self._restarts.may_restart(time.monotonic_ns()):
                    self._log.critical("gives up after too many failures: %s.", why)
                    return _FAILED_TOO_OFTEN
                self._log.warning("%s; both start afresh, and the robot is not armed.", why)
                self._pause(self._restarts.pause_s)
            if self._end_reason:
                self._log.info("ends: %s.", self._end_reason)
                return _ENDED if self._is_safe else _NOT_SAFE
            after_failure = (AFTER_FAILURE,)

    def _end(self, number: int, _: object) -> None:
        self._end_reason = self._end_reason or f"ended by {signal.Signals(number).name}"

    def _pause(self, seconds: float) -> None:
        """Wait; the first signal ends the wait early."""
        poll = select.poll()
        if not self._end_reason:
            poll.register(self._woken.fileno(), select.POLLIN)
        poll.poll(seconds * 1e3)

    def _start(self, after_failure: tuple[str, ...]) -> tuple[Child, Child]:
        guards_end, daemons_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with guards_end, daemons_end, contextlib.ExitStack() as undo:
            guard = self._child("guard", (*after_failure, "--daemon-fd"), guards_end)
            undo.callback(guard.close)
            undo.callback(guard.end, _END_S, _REAP_S)
            daemon = self._child("daemon", ("--guard-fd",), daemons_end)
            undo.pop_all()
        return guard, daemon

    def _child(
        self, name: Literal["guard", "daemon"], options: Sequence[str], end: socket.socket
    ) -> Child:
        """Start a child; the last option names its end of the channel."""
        command = [*command_of(name, self._plan), *options, str(end.fileno())]
        command += ["--plan-fd", str(self._fd)]
        return Child(name, command, [self._fd, end.fileno()], time.monotonic_ns())

    def _supervise(self, guard: Child, daemon: Child) -> str:
        """Return why supervision ended: a dead or silent child, or a request to end."""
        poll = select.poll()
        for fd in (*guard.descriptors(), *daemon.descriptors(), self._woken.fileno()):
            poll.register(fd, select.POLLIN)
        silence_ns = {
            guard: self._plan.guard_silence_ms * 1_000_000,
            daemon: self._plan.daemon_silence_ms * 1_000_000,
        }
        checked_ns = time.monotonic_ns()
        while not self._end_reason:
            poll.poll(_CHECK_S * 1e3)
            now_ns = time.monotonic_ns()
            # Silence does not count while the supervisor itself was stopped.
            paused_ns = now_ns - checked_ns if now_ns - checked_ns > _PAUSE_NS else 0
            checked_ns = now_ns
            for child, limit_ns in silence_ns.items():
                child.beaten_ns += paused_ns
                if child.is_gone(now_ns):
                    return f"the {child.name} has ended"
                if not child.has_beaten:
                    limit_ns = round(_START_S * 1e9)
                if now_ns - child.beaten_ns >= limit_ns:
                    child.kill(_REAP_S)
                    return f"the {child.name} was silent, and was killed"
        return self._end_reason

    def _stop(self, guard: Child, daemon: Child) -> None:
        """End both children, the guard first, and try to put the outputs to rest."""
        if not guard.killed and guard.is_gone(time.monotonic_ns()):
            guard.kill(_REAP_S)
            if guard.code == 0:
                self._end_reason = self._end_reason or "the guard was ended"
        elif not guard.killed:
            # A guard that does not exit may leave the outputs at any value, so the time is short.
            guard.end(self._plan.guard_silence_ms / 1e3, _REAP_S)
        self._has_guarded = self._has_guarded or guard.has_beaten
        daemon.terminate()
        if guard.code == 0:
            self._is_safe = True
        else:
            self._secure(guard)
        daemon.end(_END_S, _END_S)
        try:  # Removed, so that no client connects to the old port.
            if ready_file := self._plan.daemon.get("ready_file"):
                Path(ready_file).unlink(missing_ok=True)
        except OSError as error:
            self._log.warning("the ready file cannot be removed: %s", error)
        for child in (guard, daemon):
            self._log.info("%s %s.", child.name, _exit_words(child.code))
            child.close()

    def _secure(self, guard: Child) -> None:
        """Put the outputs to rest, retrying until they obey and the guard has exited.

        A guard stuck in the kernel still holds its pins, and its system call may complete later.
        After a request to end, or if no guard ever sent a heartbeat, this gives up after 5 s.
        """
        self._failures = []
        started_ns = time.monotonic_ns()
        until_ns: int | None = None
        while True:
            has_ended = guard.has_ended()  # Checked first: a guard may write until it has ended.
            self._make_safe()
            now_ns = time.monotonic_ns()
            if self._is_safe and has_ended:
                took_ms = (now_ns - started_ns) / 1e6
                self._log.warning(
                    "the guard has exited; all outputs are at rest, after %.1f ms.", took_ms
                )
                return
            if self._is_safe:
                self._is_safe = False
                self._log_unsafe(["The guard does not end, and may still write."])
            if self._end_reason or not self._has_guarded:
                until_ns = until_ns or now_ns + round(_UNSAFE_S * 1e9)
                if now_ns >= until_ns:
                    return
            self._pause(_AGAIN_S)

    def _make_safe(self) -> None:
        failures: list[str] = []
        # The children must be ended whatever happens to the hardware.
        with (
            errors_noted(failures, "The hardware"),
            contextlib.closing(connect(*self._plan.hardware)) as hardware,
        ):
            failures += make_safe(self._plan.guard, hardware)
        self._is_safe = not failures
        self._log_unsafe(failures)

    def _log_unsafe(self, failures: list[str]) -> None:
        """Log the outputs that do not obey, whenever the list changes."""
        if failures and failures != self._failures:
            self._failures = failures
            for failure in failures:
                self._log.error("NOT SAFE: %s", failure)


def _exit_words(code: int | None) -> str:
    if code is None:
        return "does not end"
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


def main(arguments: Sequence[str]) -> None:
    """Run the supervisor; the argument is `--plan-fd N`."""
    log = log_to_stderr("supervisor")
    try:
        fd = descriptors(arguments, ("--plan-fd",))["--plan-fd"]
        plan = read_plan_fd(fd)
        code = Supervisor(plan, fd, log).run()
    except Exception as error:
        log.critical("cannot continue because of %s: %s", type(error).__name__, error)
        code = _CANNOT_START
    sys.exit(code)
