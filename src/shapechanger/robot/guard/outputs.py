"""Outputs of a robot: open, write and stop them, and estimate the applied actions."""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

from shapechanger.contract.plan import GuardPlan, OutputPlan, output_values
from shapechanger.errors import RobotError
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, OutputDriver
from shapechanger.robot.hardware import REAL, Hardware, load

if TYPE_CHECKING:  # Most robots have no servo bus.
    from shapechanger.robot.drivers.servos.bus import ServoBus


def enable_device(pin: int, hardware: Hardware) -> Any:
    """Open the pin that triggers the one-shot, at low level."""
    from gpiozero import OutputDevice  # Only robots with pins need gpiozero.

    return OutputDevice(pin, initial_value=False, pin_factory=hardware.pin_factory())


class Switches:
    """Enable pin and emergency stop button.

    Each edge of the enable pin triggers a one-shot, which keeps the enable line of the motors
    active for some ticks. When the edges end for any reason, even the death of both guard and
    supervisor, the motors on this line lose power.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._button: Any = None
        if plan.stop_pin is not None:
            from gpiozero import InputDevice

            # The button closes to ground, so a cut wire is not detected.
            factory = hardware.pin_factory()
            self._button = InputDevice(plan.stop_pin, pull_up=True, pin_factory=factory)
        pin = plan.enable_pin
        self._enable = None if pin is None else enable_device(pin, hardware)

    @property
    def pressed(self) -> bool:
        """Return whether the emergency stop button is pressed."""
        return self._button is not None and bool(self._button.is_active)

    def toggle(self) -> None:
        """Trigger the one-shot."""
        if self._enable is not None:
            self._enable.toggle()

    def close(self) -> None:
        """Set the enable pin low and release both pins."""
        if self._enable is not None:
            self._enable.off()
        for device in (self._enable, self._button):
            if device is not None:
                device.close()


# Smaller deviations of a value, -1 to 1, are ignored, because pulses are quantised: at 50 Hz, a
# step of a PCA9685 is 0.01 for a servo, and 0.05 for a controller with a fifth of its pulse range.
_STEP: Final = 0.06


def estimated(
    plan: GuardPlan, actions: Sequence[float], requested: Sequence[float], has: Sequence[float]
) -> tuple[tuple[float, ...], str]:
    """Estimate the applied actions of a robot from the values that its outputs have.

    An action without a deviating output keeps its requested value. If one deviates, the action is
    at rest if all its outputs are. Otherwise it is computed from each output that only this action
    moves, and the value farthest from rest counts; without such an output, the requested value.

    Returns:
        One number for each action; and a text that explains each deviation, "" without any.
    """
    pairs = zip(plan.outputs, requested, has, strict=True)
    deviating = [output for output, wanted, value in pairs if abs(wanted - value) > _STEP]
    if not deviating:
        return tuple(actions), ""
    rest = output_values(plan, [action.rest for action in plan.actions])
    applied: list[float] = []
    for action, decided in zip(plan.actions, actions, strict=True):
        outputs = zip(plan.outputs, has, rest, strict=True)
        moved = [one for one in outputs if one[0].mix.get(action.name)]
        if all(output not in deviating for output, _, _ in moved):
            applied.append(decided)
        elif all(abs(value - at_rest) <= _STEP for _, value, at_rest in moved):
            applied.append(action.rest)
        else:
            found = [
                (value - output.offset) / output.mix[action.name]
                for output, value, _ in moved
                if sum(map(bool, output.mix.values())) == 1
            ]
            applied.append(max(found, key=lambda v: abs(v - action.rest), default=decided))
    reasons = [f"Output {output.name}: {OUTPUTS[output.driver].differs}." for output in deviating]
    return tuple(applied), " ".join(reasons)


def _propelling_first(plan: GuardPlan) -> GuardPlan:
    """Return the plan with propelling outputs first: a slow servo must not delay them."""
    propelling = {action.name for action in plan.actions if action.propels}
    outputs = sorted(plan.outputs, key=lambda output: propelling.isdisjoint(output.mix))
    return replace(plan, outputs=tuple(outputs))


class OutputBank:
    """All outputs: opened at rest, written together, and stopped independently of each other.

    Attributes:
        values: Actual value of each output, keyed by name.
        released: Whether the outputs are released.
    """

    def __init__(self, plan: GuardPlan, hardware: Hardware) -> None:
        self._plan = plan = _propelling_first(plan)
        self._rest = tuple(action.rest for action in plan.actions)
        self._drivers: list[tuple[OutputPlan, OutputDriver]] = []
        self.released = False
        self.values = {output.name: 0.0 for output in plan.outputs}
        with ExitStack() as undo:
            for output in plan.outputs:
                driver = OUTPUTS[output.driver].open(output, hardware)
                undo.callback(driver.close)
                self._drivers.append((output, driver))
            # The servo buses, which several drivers share.
            devices = (getattr(driver, "device", None) for _, driver in self._drivers)
            self._devices: list[ServoBus] = [*dict.fromkeys(filter(None, devices))]
            for device in self._devices:
                device.begin()
            undo.pop_all()

    def write(self, actions: Sequence[float], now_ns: int) -> tuple[tuple[float, ...], str]:
        """Write all outputs, including unchanged ones: some controllers need several writes.

        Returns:
            The applied actions, and a text that explains each deviation; see `estimated`.
        """
        values = output_values(self._plan, actions)
        for (output, driver), value in zip(self._drivers, values, strict=True):
            self.values[output.name] = driver.write(value, now_ns)
        for device in self._devices:
            device.flush(grip=True)
        self.released = False
        return estimated(self._plan, actions, values, tuple(self.values.values()))

    def ready(self, alive: Callable[[], object]) -> str:
        """Reset servos on buses that had a fault; return why one cannot be reset, or ""."""
        try:
            for device in self._devices:
                device.ready(alive)
        except RobotError as error:
            return str(error)
        return ""

    def release(self) -> None:
        """Release all outputs, unless they are released already."""
        if self.released:
            return
        for output, driver in self._drivers:
            driver.release()
            self.values[output.name] = 0.0
        self.released = True

    def rest(self, now_ns: int) -> list[str]:
        """Put every output to rest, even after one of them failed; return the failures."""
        failures: list[str] = []
        values = output_values(self._plan, self._rest)
        for (output, driver), value in zip(self._drivers, values, strict=True):
            with errors_noted(failures, f"Output {output.name}"):
                self.values[output.name] = driver.write(value, now_ns)
        for device in self._devices:
            with errors_noted(failures):
                device.flush(grip=False)
        self.released = False
        return failures

    def close(self, now_ns: int) -> list[str]:
        """Put every output to rest, unless all are released, and close it; return the failures."""
        # A released output must not be energised again.
        failures = [] if self.released else self.rest(now_ns)
        for output, driver in self._drivers:
            with errors_noted(failures, f"Output {output.name}"):
                driver.close()
        self._drivers.clear()
        return failures


@contextlib.contextmanager
def errors_noted(failures: list[str], source: str = "") -> Generator[None]:
    """Record any error instead of raising it, because the next output must rest too."""
    try:
        yield
    except Exception as error:
        text = str(error) or type(error).__name__
        failures.append(f"{source}: {text}" if source else text)


def make_safe(plan: GuardPlan, hardware: Hardware) -> list[str]:
    """Put outputs to rest by opening and closing them, even if others fail; set the enable pin low.

    Outputs that stop by themselves are skipped. No other process may have the outputs open.

    Returns:
        A description of each failure.
    """
    failures: list[str] = []
    opened: list[tuple[str, OutputDriver]] = []
    for output in _propelling_first(plan).outputs:
        if OUTPUTS[output.driver].stops_itself:
            continue
        with errors_noted(failures, f"Output {output.name}"):
            opened.append((output.name, OUTPUTS[output.driver].open(output, hardware)))
    # Closed only when all are at rest: lgpio takes 100 ms for each handle that it closes.
    for name, driver in opened:
        with errors_noted(failures, f"Output {name}"):
            driver.close()
    if plan.enable_pin is not None:
        with errors_noted(failures, f"Enable pin {plan.enable_pin}"):
            enable_device(plan.enable_pin, hardware).close()
    return failures


def preload(plan: GuardPlan, source: str) -> None:
    """Import everything that `make_safe` needs without opening anything, to save time later."""
    load(source)
    for output in plan.outputs:
        OUTPUTS[output.driver]
        if over := output.settings.get("over"):
            PULSES[over]
    # A robot that does not need a library may lack it.
    libraries = ("gpiozero",)
    if source == REAL:
        libraries += ("shapechanger.robot.lgpio_pins", "gpiozero.pins.lgpio", "smbus2")
    for library in libraries:
        with contextlib.suppress(ImportError):
            importlib.import_module(library)
