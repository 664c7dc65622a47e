"""Bus of servos that pull tendons, by current or by a limited position, and its drivers.

The bus has no thread. The sensor runs one cycle of the bus per tick, which reads the servos. The
outputs only request their tensions or lengths, which are sent together once all are requested.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Final, Literal
from weakref import WeakValueDictionary

from msgspec.structs import replace

from shapechanger.contract.plan import OutputPlan, SensorPlan
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import Keys, OutputChip, SensorChip
from shapechanger.robot.drivers.servos.servo import ServoPort, TendonServo
from shapechanger.robot.drivers.servos.settings import BusSettings, ServoSettings
from shapechanger.robot.drivers.simulation import WiredOutput
from shapechanger.robot.hardware import Hardware, ServoReply

if TYPE_CHECKING:  # The guard must not load this module.
    from shapechanger.layout import Feature

Mode = Literal["off", "held", "stopping", "silent"]
"""Mode of the bus.

"off": no servo has torque. "held": servos pull as requested. "stopping": tensions ramp down, then
the servos release. "silent": no packet is sent until `set_up`, so that the watchdogs of the servos
stop them, or the power switch stops servos without a watchdog.
"""

# Each cycle reads the next one of these registers; if servos report an alert, their last one.
_AUDITED: Final = ("mark", "torque_enable", "goal", "hardware_error")


class ServoBus:
    """A bus of servos that pull tendons, which the guard drives through its outputs.

    Without further packets, the servos' own watchdogs stop them. Servos of a family without a
    watchdog get their power from a switch that the guard triggers while it runs, so they are only
    set up when the robot is armed. If one of them cannot be released, `flush` and `let_go` raise
    errors for `cut_ms`, so that the guard stops triggering the switch and the power is cut.

    In one packet, each servo waits for the answer of the previous one, so a silent servo may
    silence all later ones. The first servo that is missing in a cycle becomes a suspect, and the
    missing ones after it are read once more. Suspects are read alone, one in each cycle in which
    all others answer. So `_poll` waits for at most two timeouts.
    """

    def __init__(self, settings: BusSettings, hardware: Hardware) -> None:
        self._settings = settings
        self.servos: dict[int, TendonServo] = {}  # Keyed by id.
        self.users: set[str] = set()  # Outputs that use the bus; the last one closes it.
        self.mode: Mode = "off"
        self.is_ready = False  # Whether `set_up` has succeeded.
        self._hardware = hardware
        self._opened = ExitStack()
        self._suspects: list[int] = []  # Servos that are read alone, because they did not answer.
        self._stopped_ns = 0
        self._silent_since_ns: int | None = None
        self._cycles = 0
        self._gone = ""
        for servo in settings.servos:
            self.add(servo)

    def add(self, servo: ServoSettings) -> TendonServo:
        """Add a servo, before the bus is opened."""
        self.servos[servo.id] = made = TendonServo(servo, self._settings)
        return made

    def open(self) -> None:
        """Open the port."""
        servos = tuple(one.settings for one in self.servos.values())
        settings = replace(self._settings, servos=servos)
        self._family = settings.family
        self._port: ServoPort = self._hardware.servo_port(settings, _serial_port)
        for one in self.servos.values():
            one.port = self._port
        self._opened.callback(self._port.close)
        self._opened.callback(self._release_finally)

    def begin(self) -> None:
        """Open the bus once all of its outputs are open; set up servos with a watchdog.

        The servos do not move.
        """
        self.open()
        if self._family.has_watchdog:
            self.set_up()
            for one in self.servos.values():
                one.set_zero(knows_turns=True)

    def ready(self, alive: Callable[[], object] = lambda: None) -> None:
        """Clear all faults before the robot is armed, without torque; refuse if one persists.

        `alive` triggers the enable line and sends a heartbeat; it is called for each servo.
        """
        if self.reason or not self.is_ready:
            self.let_go()
            self.set_up(alive)
            self._silent_since_ns = None
            if not self._family.has_watchdog:
                for one in self.servos.values():
                    one.set_zero(knows_turns=False)
        if lost := [one.settings.name for one in self.servos.values() if one.zero is None]:
            raise RobotError(
                f"{', '.join(lost)} lost the power, and so the zero of its tendon: find the zeros "
                "with `shapechanger robot calibrate --zeros`, and serve the robot afresh."
            )

    def flush(self, *, grip: bool) -> None:
        """Send the requests, unless there is a fault; `grip` energises released servos first."""
        self._require_release()
        if self.reason:
            return  # The following cycles complete the stop.
        if self.mode == "off" and grip:
            self.hold()
        if self.mode == "held":
            for one in self.servos.values():
                if one.length is not None and one.zero is None:
                    text = one.settings.label
                    raise RobotError(f"{text} cannot go to a length: it has no zero.")
            with self._loss_noted():
                self._send({id_: one.tension for id_, one in self.servos.items()})

    def let_go(self) -> None:
        """Switch the torque of all servos off."""
        if self.mode not in ("off", "silent"):
            self.release()
        self._require_release()

    def close(self) -> None:
        """Let go of all tendons and close the port."""
        self._opened.close()

    @property
    def reason(self) -> str:
        """All faults of bus and servos, which stay until `set_up`; empty without faults."""
        faults = (self._gone, *(one.fault for one in self.servos.values()))
        return " ".join(fault for fault in faults if fault)

    def set_up(self, alive: Callable[[], object] = lambda: None) -> None:
        """Check and prepare all servos, without torque, and clear all faults.

        RobotError is raised if a servo does not answer, or does not match its settings.
        """
        self.is_ready = False
        if self.mode != "silent":  # A servo may still pull, until all have been set up.
            self.mode = "off"
        self._send_no_torque()
        numbers: dict[str, int | None] = {}
        for one in self.servos.values():
            text = f"{one.settings.name} (id {one.settings.id})"
            numbers[text] = one.find("model_number", alive)
        if missing := [text for text, number in numbers.items() if number is None]:
            there = ", ".join(text for text in numbers if text not in missing)
            bus = self._settings
            raise RobotError(
                f"At {bus.device}, with {bus.baud} baud, no servo answers as {', '.join(missing)}; "
                f"these answer: {there or 'none'}. Look at power, cables, ids and baud, and at "
                "the latency timer of the adapter."
            )
        for one, number in zip(self.servos.values(), numbers.values(), strict=True):
            one.check_model(number)
        for one in self.servos.values():
            alive()
            one.prepare()
        for one in self.servos.values():
            one.clear()
        self._suspects.clear()
        self.mode, self._gone, self.is_ready = "off", "", True

    def hold(self) -> None:
        """Enable the torque of all servos, with zero tension until the first goal.

        RobotError is raised if they are held already, there is a fault, or a servo refuses; after a
        refusal, all are released.
        """
        if self.mode != "off" or self.reason or not self.is_ready:
            why = "they are held already." if self.is_ready else "they are not set up."
            device = self._settings.device
            raise RobotError(f"The servos at {device} cannot be held: {self.reason or why}")
        with ExitStack() as undo:
            undo.callback(self.release)
            for one in self.servos.values():
                one.hold()
            undo.pop_all()
        self.mode = "held"

    def cycle(self, now_ns: int) -> dict[str, dict[str, float]]:
        """Read the state of all servos, and continue a stop in progress.

        The readings are keyed by tendon, see `TendonServo.see`, without silent servos.
        """
        if self.mode == "silent" or not self.is_ready:
            return {}
        heard: dict[int, ServoReply] = {}
        with self._loss_noted():
            if self.mode == "stopping":
                left = self._ramp_left(now_ns)
                self._send({id_: one.ramp_n(left) for id_, one in self.servos.items()})
            heard = self._poll()
            self._audit(heard)
        seen: dict[str, dict[str, float]] = {}
        for id_, one in self.servos.items():
            if reply := heard.get(id_):
                seen[one.settings.name] = one.see(reply.data, now_ns, pulls=self.mode != "off")
            else:
                one.miss(late=self._port.has_stray)
        self._port.has_stray = False
        if self.reason and self.mode == "held":
            for one in self.servos.values():
                one.stopped_at_n = one.goal_n
            self.mode, self._stopped_ns = "stopping", now_ns
        # Servos that cannot be reached would ignore the ramp until their power is cut.
        unreachable = self._gone and not self._family.has_watchdog
        if self.mode == "stopping" and (unreachable or self._ramp_left(now_ns) == 0.0):
            self.release()
        self._cycles += 1
        return seen

    def release(self) -> None:
        """Disable the torque of all servos at once.

        If a servo confirms neither of two attempts, the bus falls silent, so that the watchdog of
        that servo or the power switch stops it. `set_up` ends the silence.
        """
        holding = set(self.servos)
        with self._loss_noted():
            for _ in range(2):
                self._send_no_torque()
                for ids in (self._trusted, *([id_] for id_ in self._suspects)):
                    replies = self._read("torque_enable", ids)
                    holding -= {id_ for id_, reply in replies.items() if reply.data == b"\0"}
                if not holding:
                    self.mode = "off"
                    return
        names = ", ".join(one.settings.name for id_, one in self.servos.items() if id_ in holding)
        silence = f"{names} did not confirm the release, so no packet is sent any more"
        who = "the servos' own watchdogs stop" if self._family.has_watchdog else "[enable] stops"
        self._gone = f"{self._gone} {silence}: {who} them.".lstrip()
        self.mode = "silent"

    def _release_finally(self) -> None:
        if self.mode != "silent" and (self.is_ready or self._family.has_watchdog):
            self.release()
        self.is_ready = False

    def _require_release(self) -> None:
        """Raise RobotError while only the power switch can stop a servo that pulls."""
        if self.mode != "silent" or self._family.has_watchdog:
            return
        now_ns = self._hardware.clock.now_ns()
        if self._silent_since_ns is None:
            self._silent_since_ns = now_ns
        if now_ns - self._silent_since_ns < self._settings.cut_ms * 1_000_000:
            raise RobotError(self.reason)

    @contextmanager
    def _loss_noted(self) -> Generator[None]:
        """Record an error of the port as the fault of the bus."""
        try:
            yield
        except RobotError as error:
            self._gone = self._gone or str(error)

    def _send_no_torque(self) -> None:
        for one in self.servos.values():
            one.goal = 0
        self._write("torque_enable", dict.fromkeys(self.servos, 0))

    def _send(self, tensions: Mapping[int, float]) -> None:
        """Send tensions, N, keyed by id, and the positions of servos with control of the length."""
        for id_, one in self.servos.items():
            one.goal = one.goal_of(tensions[id_])
        by_length = {i: one for i, one in self.servos.items() if one.settings.control == "length"}
        if by_length:
            positions = {id_: one.goal_position for id_, one in by_length.items()}
            self._write("goal_position", positions)
        self._write("goal", {id_: one.goal for id_, one in self.servos.items()})

    def _ramp_left(self, now_ns: int) -> float:
        """Return the remaining fraction of a stop's ramp, 1 to 0."""
        gone_ns, ramp_ns = now_ns - self._stopped_ns, self._settings.ramp_ms * 1_000_000
        return 0.0 if gone_ns >= ramp_ns else min(1.0, 1.0 - gone_ns / ramp_ns)

    @property
    def _trusted(self) -> list[int]:
        return [id_ for id_ in self.servos if id_ not in self._suspects]

    def _poll(self) -> dict[int, ServoReply]:
        """Read present values; servos that did not answer, or were not asked, are missing."""
        asked = self._trusted
        heard = self._read("present", asked)
        if missing := [id_ for id_ in asked if id_ not in heard]:
            first, *behind = missing
            self._suspects.append(first)
            heard |= self._read("present", behind)
            self._suspects += [id_ for id_ in behind if id_ not in heard][:1]
        elif self._suspects:
            suspect = self._suspects.pop(0)
            heard |= (answer := self._read("present", [suspect]))
            if not answer:
                self._suspects.append(suspect)
        return heard

    def _audit(self, heard: dict[int, ServoReply]) -> None:
        """Read a register that reveals faults; drop servos that may have restarted unnoticed."""
        # A servo that did not answer may have lost power, and so the zero of its position.
        back = [one for one in heard if self.servos[one].missed]
        for one in set(back) - self._audit_register("mark", back):
            del heard[one]
        alerting = [one for one, reply in heard.items() if reply.error & self._family.alert]
        # An alert is read at once instead of in turn.
        turn = _AUDITED[self._cycles % len(_AUDITED)]
        self._audit_register("hardware_error" if alerting else turn, alerting or heard)

    def _audit_register(self, name: str, ids: Iterable[int]) -> set[int]:
        """Evaluate a register of some servos; return those that answered."""
        replies = self._read(name, [*ids])
        for one, reply in replies.items():
            value = self._family[name].decode(reply.data)
            self.servos[one].audit(name, value, pulls=self.mode != "off")
        return set(replies)

    def _read(self, name: str, ids: Sequence[int]) -> dict[int, ServoReply]:
        """Read a register of several servos with one packet, without silent servos."""
        register = self._family[name]
        heard = self._port.read(ids, register.address, register.size) if ids else {}
        return {one: reply for one, reply in heard.items() if len(reply.data) == register.size}

    def _write(self, name: str, values: Mapping[int, int]) -> None:
        """Write a register of servos with one packet, which has no reply."""
        register = self._family[name]
        data = {one: register.encode(value) for one, value in values.items()}
        self._port.write(data, register.address)


def _serial_port(settings: BusSettings) -> ServoPort:
    from shapechanger.robot.drivers.servos.serial_port import SerialServoPort  # Needs an extra.

    return SerialServoPort(settings)


# Open buses of this process, keyed by hardware and device.
_OPEN: Final = WeakValueDictionary[tuple[Hardware, str], ServoBus]()


class TendonOutput:
    """A tendon as an output; see `OutputDriver`.

    The value 0 is the pretension in both kinds of control, so that all stops end the same. The
    value 1 is the largest tension; with control "length", values above 0 go from the longest to the
    shortest length.
    """

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        place = hardware, plan.settings["device"]
        bus = _OPEN.get(place)
        if bus is None or not bus.users:
            bus = _OPEN[place] = ServoBus(BusSettings.of(plan.settings), hardware)
        self.device = bus  # The bus, which acts when all outputs are written.
        self._servo = bus.add(ServoSettings.of(plan.settings))
        bus.users.add(self._servo.settings.name)

    def write(self, value: float, now_ns: int) -> float:
        """Request a value, 0 to 1, from the next flush on; negative values count as 0.

        Return the value in effect: 0 if the bus has a fault and lets go.
        """
        if self.device.reason:
            return 0.0
        value, servo = min(max(value, 0.0), 1.0), self._servo.settings
        if servo.control == "tension":
            tension = servo.pretension_n + value * (servo.most_tension_n - servo.pretension_n)
            self._servo.request(tension)
        elif value > 0.0:
            length = servo.longest_m + value * (servo.shortest_m - servo.longest_m)
            self._servo.request(servo.most_tension_n, length)
        else:
            self._servo.request(servo.pretension_n)
        return value

    def release(self) -> None:
        """Switch the torque of all servos on the bus off."""
        self.device.let_go()

    def close(self) -> None:
        """Close the output; closing the last one closes the bus."""
        self.device.users.discard(self._servo.settings.name)
        if not self.device.users:
            self.device.close()


class TendonSensor:
    """Runs one cycle of the bus per reading; see `SensorDriver`. Its outputs must be open."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        device: str = plan.settings["device"]
        bus = _OPEN.get((hardware, device))
        if bus is None or not bus.users:
            raise RobotError(f"No output is on the servo bus at {device}.")
        self._bus = bus

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Run a cycle and return its readings, such as `FDP/length`; see `TendonServo.see`."""
        seen = self._bus.cycle(now_ns)
        if self._bus.reason:
            raise RobotError(self._bus.reason)
        return {f"{name}/{key}": x for name, found in seen.items() for key, x in found.items()}

    def close(self) -> None:
        """Do nothing, because the outputs close the bus."""


def _features(sensor: SensorPlan) -> list[Feature]:
    """Return the features of each tendon: length, speed and tension."""
    from shapechanger.layout import Element, Feature  # The guard needs no layouts.

    features: dict[str, list[Feature]] = {"length": [], "speed": [], "tension": []}
    for servo in map(ServoSettings.of, sensor.settings["tendons"].values()):
        name, part = servo.name, Element("tendon", servo.name)
        ends = (servo.shortest_m, servo.longest_m)
        low, high = ends if servo.control == "length" else (-math.inf, math.inf)
        features["length"].append(Feature(f"{name}/length", "m", low, high, part))
        features["speed"].append(Feature(f"{name}/speed", "m/s", element=part))
        most = servo.most_tension_n
        features["tension"].append(Feature(f"{name}/tension", "N", 0.0, most, part))
    return [one for kind in features.values() for one in kind]


BUS_SERVO: Final = OutputChip(
    keys=ServoSettings,
    open=TendonOutput,
    # On a bus, no level of a pin determines its state.
    wire=lambda plan, rest, duty: lambda levels: WiredOutput(None, True),
    differs="its bus has a fault and released it",
    # Its own watchdog stops it when the bus is silent, or the enable pin cuts its power; writing to
    # it would only keep it energised.
    stops_itself=True,
)
"""A servo on a bus that winds a tendon."""

TENDONS: Final = SensorChip(measures="tendons", keys=Keys, open=TendonSensor, features=_features)
"""The tendons of a servo bus."""
