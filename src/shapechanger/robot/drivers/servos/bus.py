"""Bus of servos that pull tendons, with control of the current or of a limited position.

The bus has no thread and never sleeps.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Literal

from msgspec.structs import replace

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.servos.family import COUNTS_PER_TURN, Register
from shapechanger.robot.drivers.servos.registers import RegisterBus, ServoPort, ServoReply
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.servos.tendon import ServoState, TendonServo
from shapechanger.robot.hardware import Hardware

Mode = Literal["off", "held", "stopping", "silent"]
"""Mode of the bus.

"off": no servo has torque. "held": servos pull the requested tensions. "stopping": tensions ramp
down, then the servos let go. "silent": nothing is sent any more, so that the servos' own watchdogs
stop them, or without any the power switch.
"""


@dataclass(frozen=True, slots=True)
class BusState:
    """The bus after a cycle.

    Attributes:
        at_ns: Time of the cycle.
        mode: Mode from now on.
        servos: Readings of this cycle by tendon, without servos that did not answer.
        faults: Faults as sentences, by tendon, or "" for the bus. They stay until
            `ServoBus.set_up`.
    """

    at_ns: int
    mode: Mode
    servos: Mapping[str, ServoState]
    faults: Mapping[str, str]

    @property
    def reason(self) -> str:
        """All faults as one text; empty without faults."""
        return " ".join(self.faults.values())


class ServoBus:
    """A bus of servos that pull tendons, which the guard drives through its outputs.

    Without further cycles the servos' own watchdogs stop them. Servos of a family without any get
    their power from a switch that the guard feeds while it runs, so they are only set up when the
    robot is armed. If one of them cannot be released, `flush` and `let_go` raise errors, so that
    the guard stops to feed the switch, until that has cut the power.

    Args:
        settings: The bus and its servos; `add` adds others until it is opened.
        hardware: Where its port is.

    Attributes:
        settings: The bus and its servos.
        tensions: Tension of each tendon from the next `flush` on, N; with a length its limit.
        lengths: Length beyond its zero of each tendon that is to have one, m.
        mode: Mode of the bus.
        is_ready: Whether `set_up` has succeeded.
    """

    def __init__(self, settings: BusSettings, hardware: Hardware) -> None:
        self.settings = settings
        self.tensions: dict[str, float] = {}
        self.lengths: dict[str, float] = {}
        self.mode: Mode = "off"
        self.is_ready = False
        self._hardware = hardware
        self._opened = ExitStack()
        self._ids = {servo.id: TendonServo(servo, settings) for servo in settings.servos}
        self._users: set[str] = set()
        self._stopped_ns = 0
        self._silent_since_ns: int | None = None
        self._cycles = 0
        self._gone = ""

    def add(self, servo: ServoSettings) -> None:
        """Add a servo, which has to `leave`."""
        self.settings = replace(self.settings, servos=(*self.settings.servos, servo))
        self._ids[servo.id] = TendonServo(servo, self.settings)
        self._users.add(servo.name)
        self.tensions[servo.name] = servo.pretension_n

    def leave(self, name: str) -> None:
        """Let a servo that was added leave; the last one closes the bus."""
        self._users.discard(name)
        if not self._users:
            self.close()

    @property
    def in_use(self) -> bool:
        """Whether a servo that was added has not left."""
        return bool(self._users)

    def open(self) -> None:
        """Open the port."""
        port = self._hardware.servo_port(self.settings, _serial_port)
        self._opened.callback(port.close)
        self._opened.callback(self._release_finally)
        self._family = family = self.settings.family
        self._names = {one.settings.name: one for one in self._ids.values()}
        self._registers = RegisterBus(port, self.settings)
        # One of them is read in each cycle, so a trip is detected within four.
        self._audited = (family.mark, family.torque_enable, family.goal, family.hardware_error)

    def begin(self) -> None:
        """Open the bus once all of its outputs are open, and set up servos that have power.

        Nothing moves.

        Raises:
            RobotError: If a servo does not respond, or is not the expected one.
        """
        self.open()
        if self._family.has_watchdog:
            self.set_up()
            self.set_zeros(self._known_zeros)

    def ready(self, alive: Callable[[], object] = lambda: None) -> None:
        """Clear all faults before the robot is armed, without moving anything.

        Args:
            alive: Feeds the enable line and the supervisor; called at least every 50 ms.

        Raises:
            RobotError: If a fault persists.
        """
        if self.faults or not self.is_ready:
            self.let_go()
            self.set_up(alive)
            self._silent_since_ns = None
            if not self._family.has_watchdog:
                self.set_zeros(self._known_zeros, knows_turns=False)
        if lost := [name for name, one in self._names.items() if one.zero is None]:
            raise RobotError(
                f"{', '.join(lost)} lost the power, and so the zero of its tendon: find the zeros "
                "with `shapechanger robot home`, and serve the robot afresh."
            )

    def flush(self, *, grip: bool) -> None:
        """Send the tensions of all servos.

        Args:
            grip: Whether released servos are energised again.

        Raises:
            RobotError: If a servo does not obey.
        """
        self._require_release()
        if self.faults:
            return  # The bus is stopping, which its cycles complete.
        if self.mode == "off" and grip:
            self.hold()
        if self.mode == "held":
            self.send(self.tensions, self.lengths)

    def let_go(self) -> None:
        """Switch the torque of all servos off."""
        if self.mode not in ("off", "silent"):
            self.release()
        self._require_release()

    def close(self) -> None:
        """Let go of all tendons and close the port."""
        self._opened.close()

    @property
    def faults(self) -> dict[str, str]:
        """Faults, as in `BusState.faults`."""
        faults = {"": self._gone, **{name: one.fault for name, one in self._names.items()}}
        return {name: fault for name, fault in faults.items() if fault}

    @property
    def _known_zeros(self) -> dict[str, int]:
        return {servo.name: servo.zero for servo in self.settings.servos}

    def set_up(self, alive: Callable[[], object] = lambda: None) -> None:
        """Check and prepare all servos, without torque, and clear all faults."""
        self.is_ready = False
        if self.mode != "silent":  # A servo may still pull, until all have been set up.
            self.mode = "off"
        self._send_no_torque()
        self._registers.set_up(alive)
        for one in self._ids.values():
            one.clear()
        self.mode, self._gone, self.is_ready = "off", "", True

    def hold(self) -> None:
        """Enable the torque of all servos, which pull nothing until the first cycle.

        Raises:
            RobotError: If there is a fault, or a servo refuses; then all have let go.
        """
        if self.mode != "off" or self.faults or not self.is_ready:
            why = " ".join(self.faults.values())
            why = why or ("they are not set up." if not self.is_ready else "they are already.")
            raise RobotError(f"The servos at {self.settings.device} are not held: {why}")
        registers, family = self._registers, self._family
        with ExitStack() as undo:
            undo.callback(self.release)
            for one in self._ids.values():
                servo, one.goal, one.length = one.settings, 0, None
                registers.write(servo.id, family.mark, 0)
                registers.set_mark(servo)
                if servo.control == "length":  # An old goal must not turn it.
                    one.position = registers.read(servo.id, family.position)
                    registers.write(servo.id, family.goal_position, one.position)
                registers.write(servo.id, family.torque_enable, 1)
            undo.pop_all()
        self.mode = "held"

    def set_zeros(self, zeros: Mapping[str, int], *, knows_turns: bool = True) -> None:
        """Set the zeros of tendons.

        Args:
            zeros: Position in counts, by name; other tendons keep theirs.
            knows_turns: Whether the servos have had power since. If not, they are read, and each
                zero is moved by whole turns to be next to the present position.

        Raises:
            RobotError: If a servo does not answer.
        """
        for name, position in zeros.items():
            one = self._names[name]
            if not knows_turns:
                at = self._registers.read(one.settings.id, self._family.position)
                position += round((at - position) / COUNTS_PER_TURN) * COUNTS_PER_TURN
            one.zero = position

    def cycle(self, now_ns: int) -> BusState:
        """Read the state of all servos, and go on with a stop."""
        if self.mode == "silent" or not self.is_ready:
            return BusState(now_ns, self.mode, {}, self.faults)
        heard: dict[int, ServoReply] = {}
        with self._loss_noted():
            if self.mode == "stopping":
                left = self._ramp_left(now_ns)
                self._send_goals({id_: one.ramp_n(left) for id_, one in self._ids.items()})
            heard = self._registers.poll(self._family.present)
            self._audit(heard)
        servos = self._evaluate(heard, now_ns, late=self._registers.port.has_stray)
        self._registers.port.has_stray = False
        if self.faults and self.mode == "held":
            self.stop(now_ns)
        # Servos that cannot be reached would ignore the ramp until their power is cut.
        unreachable = self._gone and not self._family.has_watchdog
        if self.mode == "stopping" and (unreachable or self._ramp_left(now_ns) == 0.0):
            self.release()
        self._cycles += 1
        return BusState(now_ns, self.mode, servos, self.faults)

    def send(
        self, tensions: Mapping[str, float], lengths: Mapping[str, float] | None = None
    ) -> None:
        """Send tensions, which take effect only while the bus is "held".

        If the bus is gone, the next cycle reports it.

        Args:
            tensions: Tension of each tendon, N, by name, clipped to its range; the limit for one
                with a length.
            lengths: Length beyond the zero, m, by name, of tendons with control of the length.
                Without one, such a tendon is pulled with its tension, as all others.

        Raises:
            RobotError: If a tension is not finite, or a length has no meaning. Then nothing is
                sent.
        """
        lengths = lengths or {}
        # Check all before using any.
        pulls = {
            id_: one.settings.clip(tensions[one.settings.name]) for id_, one in self._ids.items()
        }
        for name, length in lengths.items():
            servo, zero = self._names[name].settings, self._names[name].zero
            if servo.control != "length":
                raise RobotError(
                    f"{servo.words} cannot go to a length: it has control of its tension."
                )
            if zero is None:
                raise RobotError(f"{servo.words} cannot go to a length: it has no zero.")
            servo.position_at(length, zero)
        if self.mode == "held":
            for name, one in self._names.items():
                one.length = lengths.get(name)
            with self._loss_noted():
                self._send_goals(pulls)

    def stop(self, now_ns: int) -> None:
        """Start to ramp the tensions down in the coming cycles, and then to let go."""
        if self.mode == "held":
            for one in self._ids.values():
                one.begin_stop()
            self._stopped_ns = now_ns
            self.mode = "stopping"

    def release(self) -> None:
        """Disable the torque of all servos at once.

        If a servo does not confirm it, even when asked twice, the bus falls silent, so that the
        watchdog of that servo stops it, or the power switch. `set_up` ends the silence.
        """
        holding = set(self._ids)
        with self._loss_noted():
            for _ in range(2):
                self._send_no_torque()
                torques = self._registers.read_each(self._family.torque_enable)
                holding -= {one for one, torque in torques.items() if torque == 0}
                if not holding:
                    self.mode = "off"
                    return
        names = ", ".join(one.settings.name for id_, one in self._ids.items() if id_ in holding)
        silence = f"{names} did not confirm to let go, so nothing is sent any more"
        who = "the servos' own watchdogs stop" if self._family.has_watchdog else "[enable] stops"
        self._gone = f"{self._gone} {silence}: {who} them.".lstrip()
        self.mode = "silent"

    def _release_finally(self) -> None:
        if self.mode != "silent" and (self.is_ready or self._family.has_watchdog):
            self.release()
        self.is_ready = False

    def _require_release(self) -> None:
        """Raise RobotError while a servo pulls that only the power switch can stop."""
        if self.mode != "silent" or self._family.has_watchdog:
            return
        now_ns = self._hardware.clock.now_ns()
        if self._silent_since_ns is None:
            self._silent_since_ns = now_ns
        if now_ns - self._silent_since_ns < self.settings.cut_ms * 1_000_000:
            raise RobotError(" ".join(self.faults.values()))

    @contextmanager
    def _loss_noted(self) -> Generator[None]:
        """Note an error of the port as the fault of the bus."""
        try:
            yield
        except RobotError as error:
            self._gone = self._gone or str(error)

    def _send_no_torque(self) -> None:
        for one in self._ids.values():
            one.goal = 0
        self._registers.write_all(self._family.torque_enable, dict.fromkeys(self._ids, 0))

    def _send_goals(self, pulls: Mapping[int, float]) -> None:
        """Send the tensions, N, by id, and the positions of servos with control of the length."""
        positions: dict[int, int] = {}
        for id_, one in self._ids.items():
            one.goal = one.settings.goal_count(pulls[id_])
            if one.settings.control == "length":
                positions[id_] = one.goal_position
        if positions:
            self._registers.write_all(self._family.goal_position, positions)
        self._registers.write_all(self._family.goal, {id_: o.goal for id_, o in self._ids.items()})

    def _ramp_left(self, now_ns: int) -> float:
        """Return the share of the ramp of a stop that is left, 1 to 0."""
        gone_ns, ramp_ns = now_ns - self._stopped_ns, self.settings.ramp_ms * 1_000_000
        return 0.0 if gone_ns >= ramp_ns else min(1.0, 1.0 - gone_ns / ramp_ns)

    def _audit(self, heard: dict[int, ServoReply]) -> None:
        """Read a register that shows obedience, and drop servos that may have restarted."""
        # A servo that was away may have lost power, and with it the meaning of its position.
        back = [one for one in heard if self._ids[one].missed]
        for one in set(back) - self._audit_register(self._family.mark, back):
            del heard[one]
        alerting = [one for one, answer in heard.items() if answer.error & self._family.alert]
        # An alert cannot wait for its turn.
        turn = self._audited[self._cycles % len(self._audited)]
        self._audit_register(self._family.hardware_error if alerting else turn, alerting or heard)

    def _audit_register(self, register: Register, ids: Iterable[int]) -> set[int]:
        """Evaluate a register of some servos; return those that answered."""
        answers = self._registers.read_several(register, [*ids])
        for one, answer in answers.items():
            value = register.decode(answer.data)
            self._ids[one].audit(register, value, pulls=self.mode != "off")
        return set(answers)

    def _evaluate(
        self, heard: Mapping[int, ServoReply], now_ns: int, *, late: bool
    ) -> dict[str, ServoState]:
        states: dict[str, ServoState] = {}
        for servo_id, one in self._ids.items():
            if servo_id in heard:
                data = heard[servo_id].data
                states[one.settings.name] = one.see(data, now_ns, pulls=self.mode != "off")
            else:
                one.miss(late=late)
        return states


def _serial_port(settings: BusSettings) -> ServoPort:
    from shapechanger.robot.drivers.servos.serial_port import open_serial_port  # It needs an extra.

    return open_serial_port(settings)
