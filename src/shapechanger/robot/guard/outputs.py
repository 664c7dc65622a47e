"""All outputs of a robot as one."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import Any, Final, NamedTuple

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.output import (
    OUTPUT_DRIVERS,
    OutputDriver,
    SharedDevice,
    open_output,
)
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan, output_values
from shapechanger.robot.hardware import REAL, Hardware

__all__ = [
    "Done",
    "OutputBank",
    "Switches",
    "Truth",
    "drives_first",
    "enable_device",
    "make_safe",
    "preload",
]


def enable_device(pin: int, hardware: Hardware) -> Any:
    """The pin that triggers the one-shot, low."""
    from gpiozero import OutputDevice  # Not for a robot without such pins.

    return OutputDevice(pin, initial_value=False, pin_factory=hardware.pin_factory())


class Switches:
    """Toggles the enable pin, and reads the button.

    The enable pin feeds a one-shot that holds the enable line of the motors for some ticks after
    each edge. Whatever ends the edges, also a guard that is gone together with its supervisor, cuts
    the motors.

    Args:
        plan: The robot.
        hardware: Where the pins are.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._enable: Any = None
        self._button: Any = None
        if plan.stop_pin is not None:
            from gpiozero import InputDevice

            # To ground when pressed; a button whose wire is cut is not noticed.
            factory = hardware.pin_factory()
            self._button = InputDevice(plan.stop_pin, pull_up=True, pin_factory=factory)
        if plan.enable_pin is not None:
            self._enable = enable_device(plan.enable_pin, hardware)

    @property
    def pressed(self) -> bool:
        """Whether the emergency button is pressed."""
        return self._button is not None and bool(self._button.is_active)

    def toggle(self) -> None:
        """Trigger the one-shot."""
        if self._enable is not None:
            self._enable.toggle()

    def close(self) -> None:
        """Enable nothing any more, and let go of the pins."""
        if self._enable is not None:
            self._enable.off()
        for device in (self._enable, self._button):
            if device is not None:
                device.close()


# Pulses and duties have steps: those of a PCA9685 at 50 Hz are 1 % of a servo's range and 5 % of
# that of a controller which is told to use a fifth of it.
_STEP: Final = 0.06

_WHY: Final = {
    "esc": "its controller waits, brakes or changes direction",
    "dynamixel": "its bus has a fault, and lets go",
    "servo": "it turns no faster than its profile allows",
}


class Done(NamedTuple):
    """What the outputs do.

    Attributes:
        actions: One number for each action.
        reason: Which outputs do something else than they were told, and why, in words.
    """

    actions: tuple[float, ...]
    reason: str


class Truth:
    """Tells from the values of the outputs which actions they are.

    Args:
        plan: The robot.
    """

    def __init__(self, plan: GuardPlan) -> None:
        self._plan = plan
        self._rest = output_values(plan, [action.rest for action in plan.actions])
        # The outputs that each action moves, by index.
        self._moved = [
            [i for i, output in enumerate(plan.outputs) if output.mix.get(action.name, 0.0)]
            for action in plan.actions
        ]

    def done(self, actions: Sequence[float], told: Sequence[float], has: Sequence[float]) -> Done:
        """What the outputs do.

        Args:
            actions: What was decided, one number for each action.
            told: The value that each output was told.
            has: The value that it has.
        """
        others = {i for i, (a, b) in enumerate(zip(told, has, strict=True)) if abs(a - b) > _STEP}
        if not others:
            return Done(tuple(actions), "")
        outputs = self._plan.outputs
        reasons = [
            f"Output {outputs[i].name}: {_WHY.get(outputs[i].driver, 'it does something else')}."
            for i in sorted(others)
        ]
        done = tuple(self._action(i, value, others, has) for i, value in enumerate(actions))
        return Done(done, " ".join(reasons))

    def _action(self, index: int, value: float, others: set[int], has: Sequence[float]) -> float:
        """One action: the furthest from rest that an output of its own does."""
        moved = self._moved[index]
        if others.isdisjoint(moved):
            return value
        action = self._plan.actions[index]
        if all(abs(has[i] - self._rest[i]) <= _STEP for i in moved):
            return action.rest
        found = [
            (has[i] - output.offset) / output.mix[action.name]
            for i in moved
            if sum(map(bool, (output := self._plan.outputs[i]).mix.values())) == 1
        ]
        return max(found, key=lambda v: abs(v - action.rest), default=value)


def drives_first(plan: GuardPlan) -> GuardPlan:
    """The robot with the outputs that propel it first: a slow servo must not delay their stop."""
    propelling = {action.name for action in plan.actions if action.propels}
    outputs = sorted(plan.outputs, key=lambda output: propelling.isdisjoint(output.mix))
    return replace(plan, outputs=tuple(outputs))


class OutputBank:
    """Opens all outputs at rest, writes to them, and puts each to rest whatever the others do.

    Attributes:
        values: The value that each output really has, by name.
        released: Whether they let go.

    Args:
        plan: The robot.
        hardware: Where the outputs are.

    Raises:
        RobotError: If an output does not answer; those opened before are closed.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._plan = plan = drives_first(plan)
        self._rest = tuple(action.rest for action in plan.actions)
        self._truth = Truth(plan)
        self._drivers: list[tuple[OutputPlan, OutputDriver]] = []
        self.released = False
        self.values = {output.name: 0.0 for output in plan.outputs}
        with ExitStack() as undo:
            for output in plan.outputs:
                driver = open_output(output, hardware)
                undo.callback(driver.close)
                self._drivers.append((output, driver))
            self._devices = _devices(driver for _, driver in self._drivers)
            for device in self._devices:
                device.begin()
            undo.pop_all()

    def write(self, actions: Sequence[float], now_ns: int) -> Done:
        """Move all outputs, also those that have their value: some controllers need time.

        Returns:
            What they really do.
        """
        values = output_values(self._plan, actions)
        for (output, driver), value in zip(self._drivers, values, strict=True):
            self.values[output.name] = driver.write(value, now_ns)
        for device in self._devices:
            device.flush(grip=True)
        self.released = False
        return self._truth.done(actions, values, tuple(self.values.values()))

    def ready(self) -> str:
        """Make ready for commands what has had a fault.

        Returns:
            Why it cannot be, in words; empty where all outputs can move.
        """
        try:
            for device in self._devices:
                device.ready()
        except RobotError as error:
            return str(error)
        return ""

    def release(self) -> None:
        """Let all outputs go, once."""
        if self.released:
            return
        for output, driver in self._drivers:
            driver.release()
            self.values[output.name] = 0.0
        self.released = True

    def rest(self, now_ns: int) -> list[str]:
        """Put every output to rest, also after one of them failed.

        Returns:
            What failed, in words.
        """
        failures: list[str] = []
        values = output_values(self._plan, self._rest)
        for (output, driver), value in zip(self._drivers, values, strict=True):
            try:
                self.values[output.name] = driver.write(value, now_ns)
            except Exception as error:  # Whatever it is, the next output must rest too.
                failures.append(_words(output, error))
        for device in self._devices:
            try:
                device.flush(grip=False)
            except Exception as error:  # As above.
                failures.append(str(error) or type(error).__name__)
        self.released = False
        return failures

    def close(self, now_ns: int) -> list[str]:
        """Put every output to rest and close it.

        Returns:
            What failed, in words.
        """
        # What was let go must not be gripped once more.
        failures = [] if self.released else self.rest(now_ns)
        for output, driver in self._drivers:
            try:
                driver.close()
            except Exception as error:  # As above.
                failures.append(_words(output, error))
        self._drivers.clear()
        return failures


def _devices(drivers: Iterable[OutputDriver]) -> list[SharedDevice]:
    """The devices that these drivers are on, each once."""
    found: list[SharedDevice] = []
    for driver in drivers:
        device: SharedDevice | None = getattr(driver, "device", None)
        if device is not None and device not in found:
            found.append(device)
    return found


def _words(output: OutputPlan, error: Exception) -> str:
    return f"Output {output.name}: {str(error) or type(error).__name__}"


# Servos with a watchdog of their own let go when the bus is silent; whoever spoke to them now would
# only keep them awake.
_STOPS_ITSELF: Final = ("dynamixel",)


def make_safe(plan: GuardPlan, hardware: Hardware) -> list[str]:
    """Open every output, which is at rest then, and close it; one that fails keeps no other.

    Nobody else may have the outputs open.

    Returns:
        What failed, in words.
    """
    failures: list[str] = []
    opened: list[tuple[str, OutputDriver]] = []
    for output in drives_first(plan).outputs:
        if output.driver in _STOPS_ITSELF:
            continue
        try:
            opened.append((output.name, open_output(output, hardware)))
        except Exception as error:  # Whatever it is, the next output must be safe too.
            failures.append(f"Output {output.name}: {str(error) or type(error).__name__}")
    # Closed only when all are at rest: lgpio takes 100 ms for each handle that it closes.
    for name, driver in opened:
        try:
            driver.close()
        except Exception as error:  # As above.
            failures.append(f"Output {name}: {str(error) or type(error).__name__}")
    if plan.enable_pin is not None:
        try:
            enable_device(plan.enable_pin, hardware).close()
        except Exception as error:  # As above.
            failures.append(f"Enable pin {plan.enable_pin}: {str(error) or type(error).__name__}")
    return failures


def preload(plan: GuardPlan, source: str) -> None:
    """Load everything that `make_safe` needs, and open nothing: later there is no time for it.

    Args:
        plan: The robot.
        source: Where its hardware comes from.
    """
    modules = [source.partition(":")[0]]
    modules += [
        OUTPUT_DRIVERS[output.driver]
        for output in plan.outputs
        if output.driver not in _STOPS_ITSELF
    ]
    if plan.enable_pin is not None:
        modules.append("gpiozero")
    for module in modules:
        importlib.import_module(module)
    if source != REAL:
        return
    for library in ("shapechanger.robot.drivers.lgpio_pins", "gpiozero.pins.lgpio", "smbus2"):
        # `RealHardware` loads these when it needs them; a robot without pins has no lgpio.
        with contextlib.suppress(ImportError):
            importlib.import_module(library)
