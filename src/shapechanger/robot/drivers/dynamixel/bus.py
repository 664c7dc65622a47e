"""The servos of a rig as one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.dynamixel.health import (
    BusState,
    Mode,
    ServoHealth,
    ServoState,
    cap_count,
    goal_count,
    length_m,
    lengthening,
    tension_n,
    within,
)
from shapechanger.robot.drivers.dynamixel.protocol import (
    ALERT,
    BUS_WATCHDOG,
    CURRENT_LIMIT,
    CURRENT_MODE,
    DRIVE_MODE,
    FIRMWARE,
    GOAL_CURRENT,
    HARDWARE_ERROR,
    OPERATING_MODE,
    PRESENT,
    RETURN_DELAY,
    TORQUE_ENABLE,
    WATCHDOG_STEP_NS,
    Asking,
    OpenPort,
    Register,
    ServoReply,
    Wire,
    decode_present,
    hardware_errors,
    open_serial_port,
)
from shapechanger.robot.drivers.dynamixel.settings import BusSettings, ServoSettings

__all__ = ["Ramp", "ServoBus", "find", "grip", "make_ready", "watchdog_steps"]


class Ramp:
    """From some tensions to others, in a straight line over time.

    Args:
        start: Tension of each tendon at the beginning, N, by name.
        end: At the end; the same names.
        since_ns: When it begins.
        ramp_ms: How long it takes.
    """

    def __init__(
        self, start: Mapping[str, float], end: Mapping[str, float], since_ns: int, ramp_ms: int
    ) -> None:
        # Nobody pulls harder because of a stop.
        self._start = {name: max(value, end[name]) for name, value in start.items()}
        self._end = dict(end)
        self._since_ns = since_ns
        self._ramp_ns = ramp_ms * 1_000_000

    def tensions(self, now_ns: int) -> dict[str, float]:
        """What each tendon pulls now, N."""
        left = self._left(now_ns)
        return {
            name: self._end[name] + left * (value - self._end[name])
            for name, value in self._start.items()
        }

    def is_over(self, now_ns: int) -> bool:
        """Whether all of them are at the end."""
        return self._left(now_ns) == 0.0

    def _left(self, now_ns: int) -> float:
        """How much of the way is left, 1 to 0."""
        gone_ns = now_ns - self._since_ns
        if gone_ns >= self._ramp_ns:
            return 0.0
        return min(1.0, 1.0 - gone_ns / self._ramp_ns)


def watchdog_steps(bus: BusSettings) -> int:
    """The time of the watchdog in steps of 20 ms."""
    return bus.watchdog_ms * 1_000_000 // WATCHDOG_STEP_NS


def find(wire: Wire, bus: BusSettings) -> None:
    """Check that every servo answers and is what it should be.

    Raises:
        RobotError: If one is missing, is of another model, or its firmware is too old.
    """
    models = {servo.id: wire.ping(servo.id) for servo in bus.servos}
    if missing := [f"{one.name} (id {one.id})" for one in bus.servos if models[one.id] is None]:
        there = [f"{one.name} (id {one.id})" for one in bus.servos if models[one.id] is not None]
        raise RobotError(
            f"At {bus.device}, with {bus.baud} baud, no servo answers as {', '.join(missing)}; "
            f"those that do: {', '.join(there) or 'none'}. Look at power, cables, ids and baud, "
            "and at the latency timer of the adapter."
        )
    for servo in bus.servos:
        known, number = servo.known, models[servo.id]
        if number != known.number:
            raise RobotError(
                f"{servo.words} is no {known.name}: its model number is {number}, "
                f"not {known.number}."
            )
        firmware = wire.read(servo.id, FIRMWARE)
        if firmware < known.least_firmware:
            raise RobotError(
                f"{servo.words} has firmware {firmware}; its own watchdog needs "
                f"{known.least_firmware} or newer."
            )


def make_ready(wire: Wire, bus: BusSettings, servo: ServoSettings) -> None:
    """Make one servo ready to pull: current mode, its caps, no goal, and no torque.

    Raises:
        RobotError: If it does not answer, refuses, or has switched itself off.
    """
    wire.write(servo.id, TORQUE_ENABLE, 0)
    wire.write(
        servo.id, BUS_WATCHDOG, 0
    )  # A watchdog that has tripped keeps all goals as they are.
    if error := wire.read(servo.id, HARDWARE_ERROR):
        words = ", ".join(hardware_errors(error)) or f"it gives the unknown code {error}"
        raise RobotError(
            f"{servo.words} has switched itself off: {words}. Only a reboot gives it torque again, "
            "after which it must find its zero afresh."
        )
    # These last without power, and wear out: they are written only where they differ.
    _keep(wire, servo, RETURN_DELAY, 0)
    _keep(wire, servo, DRIVE_MODE, 0)
    _keep(wire, servo, OPERATING_MODE, CURRENT_MODE)
    _keep(wire, servo, CURRENT_LIMIT, cap_count(servo))
    # A change of the mode sets the goal to the limit.
    wire.write(servo.id, GOAL_CURRENT, 0)
    wire.write(servo.id, BUS_WATCHDOG, watchdog_steps(bus))


def grip(wire: Wire, bus: BusSettings, servo: ServoSettings) -> None:
    """Give one servo torque; it pulls nothing yet, and its watchdog looks after it.

    Raises:
        RobotError: If it does not answer or refuses.
    """
    wire.write(servo.id, BUS_WATCHDOG, 0)
    wire.write(servo.id, GOAL_CURRENT, 0)
    wire.write(servo.id, BUS_WATCHDOG, watchdog_steps(bus))
    wire.write(servo.id, TORQUE_ENABLE, 1)


def _keep(wire: Wire, servo: ServoSettings, register: Register, value: int) -> None:
    if wire.read(servo.id, register) != value:
        wire.write(servo.id, register, value)


# One of them is read in each cycle; so a trip is known after four.
_AUDITED: Final = (BUS_WATCHDOG, TORQUE_ENABLE, GOAL_CURRENT, HARDWARE_ERROR)


class ServoBus:
    """Pulls tendons.

    `set_up` is done once, then `hold`, then `cycle` again and again, and `stop` in the end. Whoever
    stops calling `cycle` leaves the servos to their own watchdogs.

    Args:
        settings: What is attached.
        open_port: What opens the port; a twin brings its own.

    Raises:
        RobotError: If the port cannot be opened.
    """

    def __init__(self, settings: BusSettings, open_port: OpenPort = open_serial_port) -> None:
        self._settings = settings
        self._servos = {servo.name: servo for servo in settings.servos}
        self._wire = Wire(open_port(settings), settings.device)
        self._ids = {servo.id: servo for servo in settings.servos}
        self._asking = Asking(self._wire, tuple(self._ids), fast=settings.fast)
        self._health = {servo.id: ServoHealth(servo, settings) for servo in settings.servos}
        self._zeros: dict[str, int] = {}
        self._mode: Mode = "off"
        self._ramp: Ramp | None = None
        self._goals = dict.fromkeys(self._ids, 0)  # Counts, as sent last.
        self._asked = dict.fromkeys(self._servos, 0.0)  # N, as asked for last.
        self._cycles = 0
        self._gone = ""
        self._is_ready = False

    @property
    def mode(self) -> Mode:
        """What the bus does."""
        return self._mode

    @property
    def zeros(self) -> dict[str, int]:
        """Position of each servo at the zero of its tendon, in counts; who has none is missing."""
        return dict(self._zeros)

    @property
    def faults(self) -> dict[str, str]:
        """What is wrong, as in `BusState.faults`."""
        return self._faults()

    @property
    def is_ready(self) -> bool:
        """Whether it was set up."""
        return self._is_ready

    def set_up(self) -> None:
        """Find the servos, make them ready without torque, and forget all faults.

        Raises:
            RobotError: If one is missing, is something else, refuses, or has switched itself off.
        """
        self._mode, self._ramp, self._gone, self._is_ready = "off", None, "", False
        self._goals = dict.fromkeys(self._ids, 0)
        self._wire.sync_write(TORQUE_ENABLE, dict.fromkeys(self._ids, 0))
        find(self._wire, self._settings)
        for servo in self._settings.servos:
            make_ready(self._wire, self._settings, servo)
        self._asking.suspects.clear()
        for health in self._health.values():
            health.clear()
        self._is_ready = True

    def hold(self) -> None:
        """Give all servos torque. They pull nothing until the first cycle.

        Raises:
            RobotError: If there is a fault, or one does not obey: then all have let go.
        """
        if self._mode != "off" or self._faults() or not self._is_ready:
            why = " ".join(self._faults().values())
            why = why or ("they are not set up." if not self._is_ready else "they are already.")
            raise RobotError(f"The servos at {self._settings.device} are not held: {why}")
        self._goals = dict.fromkeys(self._ids, 0)
        try:
            for servo in self._settings.servos:
                grip(self._wire, self._settings, servo)
        except RobotError:
            self.release()
            raise
        self._mode = "held"

    def set_zeros(self, zeros: Mapping[str, int]) -> None:
        """Say where the tendons have their zeros, as `Homing` finds them.

        Args:
            zeros: Position in counts, by name; the others keep theirs.

        Raises:
            UnknownName: If there is no such tendon.
        """
        for name, position in zeros.items():
            self._servo(name)
            self._zeros[name] = position
            self._health[self._servos[name].id].was_reset = False

    def cycle(self, tensions: Mapping[str, float] | None, now_ns: int) -> BusState:
        """Tell the servos what to pull, and hear what they do.

        Args:
            tensions: N for each tendon, by name. It is kept between pretension and cap, and counts
                only while the bus is "held". None keeps what was asked for last.
            now_ns: The time.

        Raises:
            RobotError: If a tension is missing or no number. Then nothing is sent.
            UnknownName: If there is no such tendon.
        """
        if tensions is not None:
            self._ask_for(tensions)
        if self._mode == "silent":
            return BusState(now_ns, "silent", {}, self._missed(), self._faults())
        heard: dict[int, ServoReply] = {}
        self._wire.has_stray = False
        try:
            self._tell(now_ns)
            heard = self._asking.read(PRESENT)
            self._audit(heard)
        except RobotError as error:
            self._gone = self._gone or str(error)
        servos = self._judge(heard, now_ns, late=self._wire.has_stray)
        if self._faults() and self._mode == "held":
            self.stop(now_ns)
        if self._ramp is not None and self._ramp.is_over(now_ns):
            self.release()
        self._cycles += 1
        return BusState(now_ns, self._mode, servos, self._missed(), self._faults())

    def tell(self, tensions: Mapping[str, float]) -> None:
        """Tell the servos what to pull, and ask nothing: for what cannot wait for a cycle.

        Like `cycle`, it counts only while the bus is "held". A bus that is gone is a fault, which
        the next cycle says.

        Raises:
            RobotError: If a tension is missing or no number. Then nothing is sent.
            UnknownName: If there is no such tendon.
        """
        self._ask_for(tensions)
        if self._mode != "held":
            return
        try:
            self._tell(0)  # Only a ramp needs the time.
        except RobotError as error:
            self._gone = self._gone or str(error)

    def stop(self, now_ns: int) -> None:
        """Begin to take the tensions down; the cycles after this one do it, and then let go."""
        if self._mode == "held":
            # Where nothing was pulled yet, a stop does not begin to.
            start = {one.name: self._goal_n(one) for one in self._settings.servos}
            end = {name: min(self._servos[name].pretension_n, n) for name, n in start.items()}
            self._ramp = Ramp(start, end, now_ns, self._settings.ramp_ms)
            self._mode = "stopping"

    def release(self) -> None:
        """Let go at once.

        A servo that does not confirm it, twice asked, gets no more packets, and nobody else does:
        then its own watchdog stops it. `set_up` speaks again.
        """
        self._ramp = None
        self._goals = dict.fromkeys(self._ids, 0)
        holding = set(self._ids)
        try:
            for _ in range(2):
                self._wire.sync_write(TORQUE_ENABLE, dict.fromkeys(self._ids, 0))
                holding -= self._let_go()
                if not holding:
                    self._mode = "off"
                    return
        except RobotError as error:
            self._gone = self._gone or str(error)
        names = ", ".join(servo.name for one, servo in self._ids.items() if one in holding)
        words = f"{names} did not confirm to let go, so nothing is sent any more"
        self._gone = f"{self._gone} {words}: the servos' own watchdogs stop them.".lstrip()
        self._mode = "silent"

    def reboot(self, name: str) -> None:
        """Start one servo afresh, without torque; its tendon loses its zero.

        Raises:
            UnknownName: If there is no such tendon.
            RobotError: If the bus is not "off", or the servo does not answer.
        """
        servo = self._servo(name)
        if self._mode != "off":
            raise RobotError(f"{servo.words} is not started afresh while the bus is {self._mode}.")
        self._zeros.pop(name, None)
        self._is_ready = False
        self._wire.reboot(servo.id)

    def close(self) -> None:
        """Let go of everything."""
        if self._mode != "silent":
            self.release()
        self._wire.close()

    def _let_go(self) -> set[int]:
        """Who says that it has no torque."""
        groups = [[*self._asking.trusted], *([one] for one in self._asking.suspects)]
        return {
            servo_id
            for group in filter(None, groups)
            for servo_id, answer in self._wire.sync_read(TORQUE_ENABLE, group).items()
            if TORQUE_ENABLE.decode(answer.data) == 0
        }

    def _ask_for(self, tensions: Mapping[str, float]) -> None:
        for name in tensions:
            self._servo(name)
        if missing := [name for name in self._servos if name not in tensions]:
            raise RobotError(f"There is no tension for {', '.join(missing)}.")
        for name, servo in self._servos.items():
            within(servo, tensions[name])  # All are looked at before one counts.
        self._asked = {name: tensions[name] for name in self._servos}

    def _tell(self, now_ns: int) -> None:
        if self._mode == "off":
            return
        wanted = self._asked if self._ramp is None else self._ramp.tensions(now_ns)
        for name, servo in self._servos.items():
            # What is at fault pulls no more, while the others go down in their time.
            ill = self._mode == "stopping" and self._health[servo.id].fault
            pull = wanted[name] if self._ramp is not None else within(servo, wanted[name])
            self._goals[servo.id] = 0 if ill else goal_count(servo, pull)
        self._wire.sync_write(GOAL_CURRENT, self._goals)

    def _audit(self, heard: dict[int, ServoReply]) -> None:
        """Read what shows whether they still obey; who cannot be trusted is no longer heard."""
        # Who was away may have been without power: then its position means something else.
        back = [one for one in heard if self._health[one].missed]
        known = self._look(BUS_WATCHDOG, back)
        for one in back:
            if one not in known:
                del heard[one]
        alarmed = [one for one, answer in heard.items() if answer.error & ALERT]
        # An alarm cannot wait for its turn.
        register = HARDWARE_ERROR if alarmed else _AUDITED[self._cycles % len(_AUDITED)]
        self._look(register, alarmed or [*heard])

    def _look(self, register: Register, ids: list[int]) -> set[int]:
        """Hand a register of some servos to who judges them; who was heard."""
        answers = self._wire.sync_read(register, ids) if ids else {}
        for one, answer in answers.items():
            pulls, goal = self._mode != "off", self._goals[one]
            self._health[one].audit(register, register.decode(answer.data), pulls=pulls, goal=goal)
        return set(answers)

    def _judge(
        self, heard: Mapping[int, ServoReply], now_ns: int, *, late: bool
    ) -> dict[str, ServoState]:
        states: dict[str, ServoState] = {}
        for servo_id, servo in self._ids.items():
            health = self._health[servo_id]
            if health.was_reset:
                self._zeros.pop(servo.name, None)
            if servo_id not in heard:
                health.miss(late=late)
                continue
            present = decode_present(heard[servo_id].data)
            zero = self._zeros.get(servo.name)
            length = None if zero is None else length_m(servo, present.position, zero)
            health.see(present, length, now_ns, pulls=self._mode != "off")
            states[servo.name] = ServoState(
                position=present.position,
                length_m=length,
                lengthening_m_per_s=lengthening(servo, present.speed),
                tension_n=tension_n(servo, present.current),
                goal_n=self._goal_n(servo),
                is_capped=self._mode == "held" and self._asked[servo.name] > servo.most_tension_n,
                voltage_v=present.voltage,
                temperature_c=present.temperature,
            )
        return states

    def _goal_n(self, servo: ServoSettings) -> float:
        return tension_n(servo, self._goals[servo.id])

    def _missed(self) -> dict[str, int]:
        return {servo.name: self._health[one].missed for one, servo in self._ids.items()}

    def _faults(self) -> dict[str, str]:
        faults = {"": self._gone} if self._gone else {}
        for servo_id, servo in self._ids.items():
            if fault := self._health[servo_id].fault:
                faults[servo.name] = fault
        return faults

    def _servo(self, name: str) -> ServoSettings:
        if name not in self._servos:
            raise UnknownName("tendon", name, self._servos)
        return self._servos[name]
