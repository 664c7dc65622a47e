"""Relay on a pin, as another package would add it."""

from collections.abc import Callable

from shapechanger.contract.plan import OutputPlan
from shapechanger.robot.drivers.chip import Keys, OutputChip, device_errors
from shapechanger.robot.drivers.pins import Pin
from shapechanger.robot.drivers.simulation import DutyOf, Levels, WiredOutput
from shapechanger.robot.hardware import Hardware


class RelayKeys(Keys, frozen=True, kw_only=True):
    """Keys of a relay: the pin of its coil."""

    pin: Pin


class Relay:
    """Relay that is on for values above 0.5; see `OutputDriver`."""

    def __init__(self, plan: OutputPlan, hardware: Hardware) -> None:
        from gpiozero import DigitalOutputDevice

        keys = RelayKeys.of(plan.settings)
        with device_errors(f"Output {plan.name!r}"):
            factory = hardware.pin_factory()
            self._coil = DigitalOutputDevice(keys.pin, pin_factory=factory)

    def write(self, value: float, now_ns: int) -> float:
        self._coil.value = value > 0.5
        return float(value > 0.5)

    def release(self) -> None:
        self._coil.off()

    def close(self) -> None:
        self._coil.off()
        self._coil.close()


def _wired(plan: OutputPlan, rest: float, duty: DutyOf) -> Callable[[Levels], WiredOutput]:
    keys = RelayKeys.of(plan.settings)

    def state(levels: Levels) -> WiredOutput:
        value = duty(levels, keys.pin)
        return WiredOutput(value, value == rest)

    return state


CHIP = OutputChip(keys=RelayKeys, open=Relay, wire=_wired)
