"""Starts guard and daemon, listens to their hearts, and makes the outputs safe when one fails.

It is the parent of both, and does nothing else, so that there is nothing in it that could fail. A
guard that is gone or silent cannot put the outputs to rest, and a Raspberry Pi keeps the levels of
its pins; so then the supervisor does it. After that both are started afresh, and the new guard is
not armed.

Exit codes: 0 when it was told to end (SIGTERM, SIGINT, SIGHUP, or an order "end" to the guard); 1
when the processes failed too often; 2 when it cannot start; 3 when it ends and an output did not
obey. In all cases but the last the outputs are at rest, as far as they say.
"""

from __future__ import annotations

import logging
import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.robot.guard import start
from shapechanger.robot.guard.arguments import descriptors
from shapechanger.robot.guard.child import Child
from shapechanger.robot.guard.log import log_to_stderr
from shapechanger.robot.guard.priority import run_promptly
from shapechanger.robot.guard.restarts import Restarts
from shapechanger.robot.guard.safe_pins import make_safe, preload
from shapechanger.robot.guard.serve_plan import ServePlan, read_plan_fd
from shapechanger.robot.hardware import connect

__all__ = ["Commands", "Supervisor", "main"]

_ENDED: Final = 0
_FAILED_TOO_OFTEN: Final = 1
_CANNOT_START: Final = 2
_NOT_SAFE: Final = 3

_START_S: Final = 30.0  # Until the first heartbeat: a Pi Zero loads a daemon for several seconds.
_DAEMON_SILENCE_S: Final = 2.0
_END_S: Final = 1.0  # For a process to end when it is told to.
_REAP_S: Final = 0.05  # For a killed process to be gone; the pins do not wait any longer.
_LOOK_S: Final = 0.02  # Between two looks at the hearts.
_PAUSE_NS: Final = 100_000_000  # A longer time between two looks means that this did not run.


@dataclass(frozen=True, slots=True)
class Commands:
    """What to run, without the descriptors.

    Attributes:
        guard: The guard.
        daemon: The daemon.
    """

    guard: tuple[str, ...]
    daemon: tuple[str, ...]

    @classmethod
    def of(cls, plan: ServePlan) -> Commands:
        """Our own guard and daemon."""
        return cls(
            guard=(plan.python, "-I", str(Path(start.__file__).resolve()), "guard"),
            # -P: the folder where it is started must not hide a module.
            daemon=(plan.python, "-P", "-m", "shapechanger.robot.daemon"),
        )


class Supervisor:
    """Runs the processes of one robot.

    Args:
        plan: What they are started with.
        fd: Descriptor of the plan, which they inherit.
        commands: What to run.
        log: Where to say what happens.
    """

    def __init__(self, plan: ServePlan, fd: int, commands: Commands, log: logging.Logger) -> None:
        self._plan = plan
        self._fd = fd
        self._commands = commands
        self._log = log
        self._restarts = Restarts()
        self._told = ""
        self._is_safe = True
        # A signal makes this readable, so that the loop wakes up.
        self._woken, self._waker = socket.socketpair()
        for end in (self._woken, self._waker):
            end.setblocking(False)

    def run(self) -> int:
        """Run the processes until told to end.

        Returns:
            The exit code.
        """
        preload(self._plan.guard, self._plan.hardware[0])
        signal.set_wakeup_fd(self._waker.fileno(), warn_on_full_buffer=False)
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            if signal.getsignal(number) != signal.SIG_IGN:  # As `nohup` has it.
                signal.signal(number, self._end)
        run_promptly()
        while True:
            guard, daemon = self._start()
            why = ""
            try:
                why = self._supervise(guard, daemon)
            finally:
                self._stop(guard, daemon)
            if self._told:
                self._log.info("ends: %s.", self._told)
                return _ENDED if self._is_safe else _NOT_SAFE
            if not self._restarts.may_restart(time.monotonic_ns()):
                self._log.critical("gives up: %s, once too often.", why)
                return _FAILED_TOO_OFTEN if self._is_safe else _NOT_SAFE
            self._log.warning("%s; both start afresh, and the robot is not armed.", why)

    def _end(self, number: int, _: object) -> None:
        self._told = self._told or f"told to by {signal.Signals(number).name}"

    def _start(self) -> tuple[Child, Child]:
        guards_end, daemons_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with guards_end, daemons_end:
            guard = self._child("guard", self._commands.guard, "--daemon-fd", guards_end)
            try:
                return guard, self._child(
                    "daemon", self._commands.daemon, "--guard-fd", daemons_end
                )
            except BaseException:
                guard.end(_END_S)
                guard.close()
                raise

    def _child(self, name: str, command: Sequence[str], option: str, end: socket.socket) -> Child:
        plan = ("--plan-fd", str(self._fd))
        whole = [*command, *plan, option, str(end.fileno())]
        return Child(name, whole, [self._fd, end.fileno()], time.monotonic_ns())

    def _supervise(self, guard: Child, daemon: Child) -> str:
        """Come back when one of them is gone or silent, or when told to end, and say why."""
        poll = select.poll()
        for fd in (*guard.descriptors(), *daemon.descriptors(), self._woken.fileno()):
            poll.register(fd, select.POLLIN)
        silence_ns = {
            guard: self._plan.guard_silence_ms * 1_000_000,
            daemon: round(_DAEMON_SILENCE_S * 1e9),
        }
        looked_ns = time.monotonic_ns()
        while not self._told:
            poll.poll(_LOOK_S * 1e3)
            now_ns = time.monotonic_ns()
            # Silence counts only while somebody listens: not while this was stopped too.
            deaf_ns = now_ns - looked_ns if now_ns - looked_ns > _PAUSE_NS else 0
            looked_ns = now_ns
            for child, limit_ns in silence_ns.items():
                child.beaten_ns += deaf_ns
                if child.is_gone(now_ns):
                    return f"the {child.name} is gone"
                if not child.has_beaten:
                    limit_ns = round(_START_S * 1e9)
                if now_ns - child.beaten_ns >= limit_ns:
                    child.kill(_REAP_S)
                    return f"the {child.name} was silent, and was killed"
        return self._told

    def _stop(self, guard: Child, daemon: Child) -> None:
        """End both and leave the outputs at rest; nothing comes before the guard."""
        if guard.is_gone(time.monotonic_ns()):
            guard.kill(_REAP_S)
            if guard.code == 0:
                self._told = self._told or "the guard was told to"
        else:
            # One that does not end may hold the outputs anywhere, so it has no longer than that.
            guard.end(self._plan.guard_silence_ms / 1e3)
        if guard.code == 0:
            self._is_safe = True
        else:
            self._make_safe()
        daemon.end(_END_S)
        for child in (guard, daemon):
            self._log.info("%s %s.", child.name, _words(child.code))
            child.close()

    def _make_safe(self) -> None:
        started_ns = time.monotonic_ns()
        failures = _collected(lambda: _safe(self._plan))
        self._is_safe = not failures
        for failure in failures:
            self._log.error("NOT SAFE: %s", failure)
        if not failures:
            took_ms = (time.monotonic_ns() - started_ns) / 1e6
            self._log.warning("the guard left; all outputs are at rest, after %.1f ms.", took_ms)


def _safe(plan: ServePlan) -> list[str]:
    hardware = connect(*plan.hardware)
    try:
        return make_safe(plan.guard, hardware)
    finally:
        hardware.close()


def _collected(work: Callable[[], list[str]]) -> list[str]:
    """What failed in some work, also when all of it did."""
    try:
        return work()
    except Exception as error:  # The processes must be ended whatever happens to the pins.
        return [f"The hardware: {str(error) or type(error).__name__}"]


def _words(code: int | None) -> str:
    if code is None:
        return "does not end"
    return f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"


def main(arguments: Sequence[str]) -> None:
    """Run the supervisor; the argument is `--plan-fd N`."""
    log = log_to_stderr("supervisor")
    try:
        fd = descriptors(arguments, ("--plan-fd",))["--plan-fd"]
        plan = read_plan_fd(fd)
        code = Supervisor(plan, fd, Commands.of(plan), log).run()
    except Exception as error:
        log.critical("cannot go on, for %s: %s", type(error).__name__, error)
        code = _CANNOT_START
    sys.exit(code)
