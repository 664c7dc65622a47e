"""All outputs of a robot as one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace

from shapechanger.errors import RobotError
from shapechanger.robot.drivers.output import OutputDriver, SharedDevice, open_output
from shapechanger.robot.guard.mix import output_values
from shapechanger.robot.guard.plan import GuardPlan, OutputPlan
from shapechanger.robot.guard.truth import Done, Truth
from shapechanger.robot.hardware import Hardware

__all__ = ["Outputs", "drives_first"]


def drives_first(plan: GuardPlan) -> GuardPlan:
    """The robot with the outputs that propel it first: a slow servo must not delay their stop."""
    propelling = {action.name for action in plan.actions if action.propels}
    outputs = sorted(plan.outputs, key=lambda output: propelling.isdisjoint(output.mix))
    return replace(plan, outputs=tuple(outputs))


class Outputs:
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
