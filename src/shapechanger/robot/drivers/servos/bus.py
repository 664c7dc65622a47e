"""Bus of servos that pull tendons, with control of the current or of a limited position.

The bus has no thread, never sleeps, and takes the time from its caller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from shapechanger.errors import RobotError, UnknownName
from shapechanger.robot.drivers.servos.family import COUNTS_PER_TURN, Register
from shapechanger.robot.drivers.servos.health import BusState, Mode, ServoHealth, ServoState
from shapechanger.robot.drivers.servos.registers import RegisterBus, ServoPort, ServoReply
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings

# Counts ahead of its position to which a servo with control of the length is sent to pull.
_AHEAD: Final = 1024


class ServoBus:
    """A bus of servos that pull tendons.

    Call `set_up` once, then `hold`, then `cycle` regularly, and finally `stop`. Without further
    cycles the servos' own watchdogs stop them, or in a family without any their power switch must.

    Args:
        settings: The bus and its servos.
        port: Port of the bus, which `close` closes.

    Attributes:
        mode: Mode of the bus.
        is_ready: Whether `set_up` has succeeded.
        zeros: Position of each servo at the zero of its tendon, in counts, for those with a zero.
    """

    def __init__(self, settings: BusSettings, port: ServoPort) -> None:
        self._settings = settings
        self._family = family = settings.family
        self._servos = {servo.name: servo for servo in settings.servos}
        self._ids = {servo.id: servo for servo in settings.servos}
        self._registers = RegisterBus(port, settings.device, family, tuple(self._ids))
        # One of them is read in each cycle, so a trip is detected within four.
        self._audited = (family.mark, family.torque_enable, family.goal, family.hardware_error)
        self._health = {servo.id: ServoHealth(servo, settings) for servo in settings.servos}
        self.zeros: dict[str, int] = {}
        self.mode: Mode = "off"
        self._stopped_at: dict[str, float] = {}  # N, when the stop began.
        self._stopped_ns = 0
        self._goals = dict.fromkeys(self._ids, 0)  # Counts, as last sent.
        self._pulls: dict[str, float] = {}  # N, as last requested.
        self._lengths: dict[str, float] = {}  # m, of tendons that are to have a length.
        self._positions: dict[int, int] = {}  # Counts, as last read.
        self._cycles = 0
        self._gone = ""
        self.is_ready = False

    @property
    def faults(self) -> dict[str, str]:
        """Faults, as in `BusState.faults`."""
        faults = {"": self._gone} if self._gone else {}
        for servo_id, servo in self._ids.items():
            if fault := self._health[servo_id].fault:
                faults[servo.name] = fault
        return faults

    def set_up(self, alive: Callable[[], object] = lambda: None) -> None:
        """Check and prepare all servos, without torque, and clear all faults."""
        self.is_ready = False
        if self.mode != "silent":  # A servo may still pull, until all have been set up.
            self.mode = "off"
        self._goals = dict.fromkeys(self._ids, 0)
        self._registers.write_all(self._family.torque_enable, dict.fromkeys(self._ids, 0))
        self._check_servos(alive)
        for servo in self._settings.servos:
            alive()
            self._prepare(servo)
        self._registers.suspects.clear()
        for health in self._health.values():
            health.clear()
        self.mode, self._gone, self.is_ready = "off", "", True

    def hold(self) -> None:
        """Enable the torque of all servos, which pull nothing until the first cycle.

        Raises:
            RobotError: If there is a fault, or a servo refuses; then all have let go.
        """
        if self.mode != "off" or self.faults or not self.is_ready:
            why = " ".join(self.faults.values())
            why = why or ("they are not set up." if not self.is_ready else "they are already.")
            raise RobotError(f"The servos at {self._settings.device} are not held: {why}")
        family = self._family
        self._goals = dict.fromkeys(self._ids, 0)
        self._lengths = {}
        try:
            for servo in self._settings.servos:
                self._registers.write(servo.id, family.mark, 0)
                self._set_mark(servo)
                if servo.control == "length":  # An old goal must not turn it.
                    at = self._registers.read(servo.id, family.position)
                    self._registers.write(servo.id, family.goal_position, at)
                    self._positions[servo.id] = at
                self._registers.write(servo.id, family.torque_enable, 1)
        except RobotError:
            self.release()
            raise
        self.mode = "held"

    def set_zeros(self, zeros: Mapping[str, int], *, knows_turns: bool = True) -> None:
        """Set the zeros of tendons, as `Homing` finds them.

        Args:
            zeros: Position in counts, by name; other tendons keep theirs.
            knows_turns: Whether the servos have had power since. If not, they are read, and each
                zero is moved by whole turns to be next to the present position.

        Raises:
            RobotError: If a servo does not answer.
            UnknownName: If there is no such tendon.
        """
        for name, position in zeros.items():
            servo = self._servo(name)
            if not knows_turns:
                at = self._registers.read(servo.id, self._family.position)
                position += round((at - position) / COUNTS_PER_TURN) * COUNTS_PER_TURN
            self.zeros[name] = position
            self._health[servo.id].was_reset = False

    def cycle(self, now_ns: int) -> BusState:
        """Read the state of all servos, and go on with a stop."""
        if self.mode == "silent" or not self.is_ready:
            return BusState(now_ns, self.mode, {}, self.faults)
        heard: dict[int, ServoReply] = {}
        try:
            if self.mode == "stopping":
                self._send_goals(now_ns)
            heard = self._registers.poll(self._family.present)
            self._audit(heard)
        except RobotError as error:
            self._gone = self._gone or str(error)
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
            RobotError: If a tension is missing or not finite, or a length has no meaning. Then
                nothing is sent.
            UnknownName: If there is no such tendon.
        """
        lengths = lengths or {}
        for name in tensions:
            self._servo(name)
        if missing := [name for name in self._servos if name not in tensions]:
            raise RobotError(f"There is no tension for {', '.join(missing)}.")
        # Check all before using any.
        pulls = {name: servo.clip(tensions[name]) for name, servo in self._servos.items()}
        for name, length in lengths.items():
            servo = self._servo(name)
            if servo.control != "length" or name not in self.zeros:
                lacks = (
                    "no zero" if servo.control == "length" else f"control of its {servo.control}"
                )
                raise RobotError(f"{servo.words} cannot go to a length: it has {lacks}.")
            servo.position_at(length, self.zeros[name])
        if self.mode == "held":
            self._pulls, self._lengths = pulls, dict(lengths)
            try:
                self._send_goals(0)  # The time matters only to a ramp.
            except RobotError as error:
                self._gone = self._gone or str(error)

    def stop(self, now_ns: int) -> None:
        """Start to ramp the tensions down in the coming cycles, and then to let go."""
        if self.mode == "held":
            self._stopped_at = {one.name: self._goal_n(one) for one in self._settings.servos}
            self._stopped_ns = now_ns
            self.mode = "stopping"

    def release(self) -> None:
        """Disable the torque of all servos at once.

        If a servo does not confirm it, even when asked twice, the bus falls silent, so that the
        watchdog of that servo stops it, or the power switch. `set_up` ends the silence.
        """
        self._goals = dict.fromkeys(self._ids, 0)
        enable, holding = self._family.torque_enable, set(self._ids)
        try:
            for _ in range(2):
                self._registers.write_all(enable, dict.fromkeys(self._ids, 0))
                torques = self._registers.read_each(enable)
                holding -= {one for one, torque in torques.items() if torque == 0}
                if not holding:
                    self.mode = "off"
                    return
        except RobotError as error:
            self._gone = self._gone or str(error)
        names = ", ".join(servo.name for one, servo in self._ids.items() if one in holding)
        words = f"{names} did not confirm to let go, so nothing is sent any more"
        what = "the servos' own watchdogs stop" if self._family.has_watchdog else "[enable] stops"
        self._gone = f"{self._gone} {words}: {what} them.".lstrip()
        self.mode = "silent"

    def close(self) -> None:
        """Let go of all tendons and close the port."""
        if self.mode != "silent" and (self.is_ready or self._family.has_watchdog):
            self.release()
        self._registers.port.close()

    def _check_servos(self, alive: Callable[[], object]) -> None:
        """Check that every servo answers, has the right model and firmware that is new enough."""
        bus, registers, models = self._settings, self._registers, dict[int, int | None]()
        for servo in bus.servos:
            alive()
            models[servo.id] = registers.find(servo.id, self._family.model_number)
        names = {servo.id: f"{servo.name} (id {servo.id})" for servo in bus.servos}
        if missing := [names[one] for one, number in models.items() if number is None]:
            there = [names[one] for one, number in models.items() if number is not None]
            raise RobotError(
                f"At {bus.device}, with {bus.baud} baud, no servo answers as {', '.join(missing)}; "
                f"those that do: {', '.join(there) or 'none'}. Look at power, cables, ids and "
                "baud, and at the latency timer of the adapter."
            )
        for servo in bus.servos:
            known, number = servo.known, models[servo.id]
            if number != known.number:
                raise RobotError(
                    f"{servo.words} is not an {known.name}: its model number is {number}, "
                    f"not {known.number}."
                )
            firmware = registers.read(servo.id, self._family.firmware)
            if firmware < known.least_firmware:
                raise RobotError(
                    f"{servo.words} has firmware {firmware}; its own watchdog needs "
                    f"{known.least_firmware} or newer."
                )

    def _prepare(self, servo: ServoSettings) -> None:
        """Set up the mode, the limit of the goal, no goal and no torque."""
        registers, family = self._registers, self._family
        registers.write(servo.id, family.torque_enable, 0)
        registers.write(servo.id, family.mark, 0)  # A tripped watchdog blocks all goals.
        if error := registers.read(servo.id, family.hardware_error):
            raise RobotError(
                f"{servo.words} has switched itself off: {family.error_words(error)}. Only a "
                "reboot gives it torque again, after which its zero must be found again."
            )
        if family.lock is not None:
            registers.write(servo.id, family.lock, 0)
        for register, value, kept_bits in (
            *family.constants,
            (family.mode, family.modes[servo.control], 0),
            (family.most, servo.most_counts, 0),
        ):
            # These are in the EEPROM, which wears out: write them only if they differ.
            found = registers.read(servo.id, register)
            if (wanted := found & kept_bits | value) != found:
                registers.write(servo.id, register, wanted)
                if registers.read(servo.id, register) != wanted:  # Not every family refuses.
                    raise RobotError(f"{servo.words} does not keep {wanted} as {register.name}.")
        if family.lock is not None:
            registers.write(servo.id, family.lock, 1)
        self._set_mark(servo)

    def _set_mark(self, servo: ServoSettings) -> None:
        """Set the goal to 0, and what shows a restart, which starts a watchdog."""
        # A change of mode sets the goal to the limit.
        self._registers.write(servo.id, self._family.goal, 0)
        self._registers.write(servo.id, self._family.mark, self._settings.mark)

    def _send_goals(self, now_ns: int) -> None:
        for name, servo in self._servos.items():
            pull = self._pulls.get(name, 0.0)
            if self.mode == "stopping":
                start = self._stopped_at[name]
                end = min(servo.pretension_n, start)  # A tendon that was not pulled yet stays so.
                pull = end + self._ramp_left(now_ns) * (start - end)
                if self._health[servo.id].fault:
                    pull = 0.0  # Such a servo lets go at once, while the others ramp down.
            self._goals[servo.id] = servo.goal_count(pull)
        if positions := self._goal_positions():
            self._registers.write_all(self._family.goal_position, positions)
        self._registers.write_all(self._family.goal, self._goals)

    def _goal_positions(self) -> dict[int, int]:
        """Return the goals of the servos with control of the length, in counts, by id."""
        goals: dict[int, int] = {}
        for name, servo in self._servos.items():
            if servo.control != "length":
                continue
            if name in self._lengths and name in self.zeros:
                goals[servo.id] = servo.position_at(self._lengths[name], self.zeros[name])
            else:
                goals[servo.id] = self._positions[servo.id] + servo.direction * _AHEAD
        return goals

    def _ramp_left(self, now_ns: int) -> float:
        """Return the share of the ramp of a stop that is left, 1 to 0."""
        gone_ns, ramp_ns = now_ns - self._stopped_ns, self._settings.ramp_ms * 1_000_000
        return 0.0 if gone_ns >= ramp_ns else min(1.0, 1.0 - gone_ns / ramp_ns)

    def _audit(self, heard: dict[int, ServoReply]) -> None:
        """Read a register that shows obedience, and drop servos that may have restarted."""
        # A servo that was away may have lost power, and with it the meaning of its position.
        back = [one for one in heard if self._health[one].missed]
        known = self._audit_register(self._family.mark, back)
        for one in back:
            if one not in known:
                del heard[one]
        alerting = [one for one, answer in heard.items() if answer.error & self._family.alert]
        # An alert cannot wait for its turn.
        turn = self._audited[self._cycles % len(self._audited)]
        register = self._family.hardware_error if alerting else turn
        self._audit_register(register, alerting or [*heard])

    def _audit_register(self, register: Register, ids: list[int]) -> set[int]:
        """Evaluate a register of some servos; return those that answered."""
        answers = self._registers.read_several(register, ids)
        for one, answer in answers.items():
            pulls, goal = self.mode != "off", self._goals[one]
            self._health[one].audit(register, register.decode(answer.data), pulls=pulls, goal=goal)
        return set(answers)

    def _evaluate(
        self, heard: Mapping[int, ServoReply], now_ns: int, *, late: bool
    ) -> dict[str, ServoState]:
        states: dict[str, ServoState] = {}
        for servo_id, servo in self._ids.items():
            health = self._health[servo_id]
            if health.was_reset:
                self.zeros.pop(servo.name, None)
            if servo_id not in heard:
                health.miss(late=late)
                continue
            present = self._family.decode(heard[servo_id].data)
            self._positions[servo_id] = present.position
            zero = self.zeros.get(servo.name)
            length = None if zero is None else servo.length_m(present.position, zero)
            health.see(present, length, now_ns, pulls=self.mode != "off")
            states[servo.name] = ServoState(
                position=present.position,
                length_m=length,
                lengthening_m_per_s=servo.lengthening(present.speed),
                tension_n=servo.tension_n(present.current),
                goal_n=self._goal_n(servo),
            )
        return states

    def _goal_n(self, servo: ServoSettings) -> float:
        return abs(self._goals[servo.id]) * servo.newton_per_goal

    def _servo(self, name: str) -> ServoSettings:
        if name not in self._servos:
            raise UnknownName("tendon", name, self._servos)
        return self._servos[name]
