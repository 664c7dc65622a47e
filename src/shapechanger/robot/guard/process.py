"""Guard process: the only owner of a robot's outputs.

The daemon requests, `shapechanger.robot.guard.rules.Rules` decides, and this loop writes. It ends
on SIGTERM or SIGINT, on the order "end", when the supervisor dies, and on any internal error; first
it puts the outputs to rest, unless they are released. The death of the daemon disarms the robot.

Exit codes: 0 if it was asked to end or the supervisor died, and no output failed on closing; 1
otherwise, and only then may an output not be at rest.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import msgspec

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard.channel import DaemonChannel, GuardState, Heartbeat
from shapechanger.robot.guard.outputs import OutputBank, Switches
from shapechanger.robot.guard.rules import OutputDecision, Rules
from shapechanger.robot.guard.running import (
    AFTER_FAILURE,
    GUARD,
    descriptors,
    log_to_stderr,
    read_plan_fd,
    run_promptly,
    shortened,
)
from shapechanger.robot.guard.sensors import Sensors
from shapechanger.robot.hardware import Hardware, connect

_BEAT_S: Final = 0.01
"""Least time between heartbeats, s; a guard silent for `guard_silence_ms` is killed."""

_WAIT_S: Final = 0.01  # Longest wait in real time while a twin's clock is paused, s.
_STATE_EVERY_NS: Final = 20_000_000  # Longest time between two states while ticks are on time.
_MOST_REASON_BYTES: Final = 1000  # Several reasons may be joined; a datagram holds 16 kB.


class Guard:
    """Main loop of the guard."""

    def __init__(
        self,
        plan: GuardPlan,
        hardware: Hardware,
        daemon: DaemonChannel,
        log: logging.Logger,
        *,
        after_failure: bool = False,
    ) -> None:
        self._clock = hardware.clock
        self._daemon = daemon
        self._log = log
        self._period_ns = round(1e9 / plan.tick_hz)
        now_ns = self._clock.now_ns()
        with contextlib.ExitStack() as undo:
            # Outputs first: until they are open, their pins keep their previous state.
            self._outputs = OutputBank(plan, hardware)
            undo.callback(self._close_outputs)
            self._switches = Switches(plan, hardware)
            undo.callback(self._switches.close)
            self._sensors = Sensors(plan, hardware)
            undo.callback(self._sensors.close)
            # Runs before the devices are closed, because closing the pins takes time.
            undo.callback(self._rest_outputs)
            self._opened = undo.pop_all()
        self._rules = Rules(plan, now_ns)
        if after_failure:
            self._rules.stop("the robot's processes failed and started afresh.")
        self._next_tick_ns = now_ns
        self._healthy = True
        self._heartbeat: Heartbeat | None = None
        self._failures: dict[str, str] = {}
        self._malformed = 0
        self._refused: tuple[str, int | None] = ("", None)
        self._applied: tuple[int, int | None] = (0, None)
        self._applied_ns: int | None = None
        self._sent: GuardState | None = None
        self._logged = ""
        self.is_safe = True
        """False if an output failed on closing; it may not be at rest."""
        self.ended = ""
        """Reason for ending; empty while the guard runs."""

    def run(self, heartbeat: Heartbeat) -> None:
        """Run until asked to end or the supervisor dies, and send heartbeats to it."""
        self._heartbeat = heartbeat
        self._clock.keep_alive(heartbeat.beat)
        until_ns = self._clock.now_ns()
        while not self.ended:
            fds = [heartbeat.fileno()]
            if not self._daemon.lost:  # A closed stream stays readable.
                fds += self._daemon.filenos()
            has_something = self._clock.wait(fds, until_ns, _WAIT_S)
            heartbeat.beat()
            if heartbeat.lost:
                self.ended = "the supervisor has ended"
            elif has_something:
                until_ns = self.round(self._clock.now_ns())

    def end(self, number: int, _: object) -> None:
        """End because of a signal."""
        self.ended = self.ended or f"ended by {signal.Signals(number).name}"

    def close(self) -> None:
        """Put all outputs to rest, unless they are released, and close all devices."""
        self._opened.close()

    def _rest_outputs(self) -> None:
        if not self._outputs.released:
            self._outputs.rest(self._clock.now_ns())  # Failures are reported on closing.

    def _close_outputs(self) -> None:
        for failure in self._outputs.close(self._clock.now_ns()):
            self.is_safe = False
            self._log.error("%s", failure)

    def round(self, now_ns: int) -> int:
        """Run one round and return the time of the next."""
        self._process_orders()
        if is_tick := now_ns >= self._next_tick_ns:
            self._next_tick_ns = max(self._next_tick_ns, now_ns - self._period_ns)
            self._next_tick_ns += self._period_ns
            if self._applied[1] is not None and self._rules.stands(now_ns):
                self._apply(now_ns)  # A stop that is due does not wait for the sensors.
            self._sense(now_ns)
        now_ns = self._clock.now_ns()  # Reading orders and sensors took time.
        decision = self._apply(now_ns)
        if is_tick:
            self._feed()
        self._report(decision, now_ns)
        return min(self._next_tick_ns, self._rules.next_wake_ns(now_ns))

    def _feed(self) -> None:
        """Toggle the enable pin while all outputs obey."""
        if self._healthy:
            self._switches.toggle()

    def _stay_alive(self) -> None:
        """Toggle the enable pin and send a heartbeat during a long round."""
        self._feed()
        if self._heartbeat is not None:
            self._heartbeat.beat()

    def _process_orders(self) -> None:
        orders, malformed = self._daemon.orders()
        for order in orders:
            if order.kind == "arm" and (why := self._outputs.ready(self._stay_alive)):
                self._refused = (f"Not armed: {why}", None)
                continue
            if refusal := self._rules.offer(order, self._clock.now_ns()):
                self._refused = (refusal, order.seq if order.kind == "command" else None)
            if order.kind == "end":
                self.ended = "the daemon ended it"
        if malformed:
            self._rules.halt()  # The invalid order may have been meant to replace the command.
            self._malformed += len(malformed)
            self._refused = (malformed[-1], None)
            text = shortened(malformed[-1])
            self._log.warning("%d datagrams were no orders: %s", self._malformed, text)
        if self._daemon.lost:
            self._rules.disarm("the daemon has ended.")

    def _sense(self, now_ns: int) -> None:
        self._rules.press(self._switches.pressed)
        sensing = self._sensors.read(now_ns, self._rules.direction)
        self._rules.sense(sensing, now_ns)
        for name in sensing.failures.keys() - self._failures.keys():
            self._log.warning("Sensor %s fails: %s", name, sensing.failures[name])
        for name in self._failures.keys() - sensing.failures.keys():
            self._log.info("Sensor %s responds again.", name)
        self._failures = sensing.failures

    def _apply(self, now_ns: int) -> OutputDecision:
        decision = self._rules.tick(now_ns)
        if not self._healthy:
            return self._recover(decision, now_ns)
        try:
            if decision.release:
                self._outputs.release()
            else:
                actions, text = self._outputs.write(decision.actions, now_ns)
                self._rules.set_applied(actions)
                reason = decision.stop_reason
                if decision.seq is not None:  # In a stop, an output that deviates is only late.
                    reason = f"{reason} {text}".strip()
                decision = replace(decision, actions=actions, stop_reason=reason)
        except Exception as error:  # After any error of a driver, the other outputs must rest.
            self._rules.fail(str(error) or type(error).__name__, now_ns)
            return self._recover(decision, now_ns)
        if self._applied != (decision.session, decision.seq):
            self._applied = (decision.session, decision.seq)
            self._applied_ns = None if decision.seq is None else self._clock.now_ns()
        return decision

    def _recover(self, decision: OutputDecision, now_ns: int) -> OutputDecision:
        """Put all outputs to rest; called in every round until each of them obeys."""
        failures = self._outputs.rest(now_ns)
        self._healthy = not failures
        if failures and not self._rules.emergency:
            self._rules.fail(" ".join(failures), now_ns)
        self._applied, self._applied_ns = (0, None), None
        if decision.seq is not None:
            decision = self._rules.tick(now_ns)
        if not failures:
            return decision
        text = shortened(" ".join(failures))
        return replace(decision, stop_reason=f"NOT at rest: {text} {decision.stop_reason}")

    def _report(self, decision: OutputDecision, now_ns: int) -> None:
        rules = self._rules
        (refused, refused_seq), (session, seq) = self._refused, self._applied
        state = GuardState(
            at_ns=now_ns,
            armed=rules.armed,
            emergency=rules.emergency,
            emergencies=rules.emergencies,
            stop_reason=shortened(decision.stop_reason, _MOST_REASON_BYTES),
            applied=decision.actions,
            applied_session=session,
            applied_seq=seq,
            applied_ns=self._applied_ns,
            refused=shortened(refused, _MOST_REASON_BYTES),
            refused_seq=refused_seq,
            outputs=dict(self._outputs.values),
            quantities=rules.senses.quantities,
            sources=rules.senses.sources,
            bumps=rules.bumps,
        )
        if (fact := rules.disarmed or "Armed.") != self._logged:
            self._log.info("%s", fact)
            self._logged = fact
        sent = self._sent
        # Sent on any change, and otherwise if the next tick would be too late.
        is_news = (
            sent is None
            or now_ns + self._period_ns - sent.at_ns > _STATE_EVERY_NS
            or state != msgspec.structs.replace(sent, at_ns=now_ns)
        )
        if is_news and not self._daemon.lost and self._daemon.send(state):
            self._sent = msgspec.structs.replace(state, refused="", refused_seq=None)
            self._refused = ("", None)


def main(arguments: Sequence[str]) -> None:
    """Run the guard.

    The arguments are `--plan-fd N --daemon-fd N --heartbeat-fd N`, preceded by `--after-failure` if
    earlier processes of this robot failed.
    """
    log = log_to_stderr("guard")
    try:
        _guard(arguments, log)
    except Exception as error:
        log.critical("ends because of %s: %s", type(error).__name__, error)
        sys.exit(1)


def _guard(arguments: Sequence[str], log: logging.Logger) -> None:
    after_failure = list(arguments[:1]) == [AFTER_FAILURE]
    names = ("--plan-fd", "--daemon-fd", "--heartbeat-fd")
    fds = descriptors(arguments[1:] if after_failure else arguments, names)
    ends = {signal.SIGTERM, signal.SIGINT}
    signal.pthread_sigmask(signal.SIG_BLOCK, ends)  # Signals wait until the guard exists.
    with contextlib.ExitStack() as opened:
        daemon = DaemonChannel(fds["--daemon-fd"])
        opened.callback(daemon.close)
        heartbeat = Heartbeat(fds["--heartbeat-fd"], _BEAT_S)
        opened.callback(heartbeat.leave)
        plan = read_plan_fd(fds["--plan-fd"])
        hardware = connect(*plan.hardware)
        opened.callback(hardware.close)
        guard = Guard(plan.guard, hardware, daemon, log, after_failure=after_failure)
        opened.callback(guard.close)
        for number in ends:
            signal.signal(number, guard.end)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, ends)
        run_promptly(GUARD)
        log.info("guards %s with %d outputs.", plan.guard.name, len(plan.guard.outputs))
        guard.run(heartbeat)
        log.info("ends: %s.", guard.ended)
    if not guard.is_safe:
        raise RobotError("not all outputs are at rest")
