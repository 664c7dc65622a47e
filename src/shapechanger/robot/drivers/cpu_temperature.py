"""CPU temperature from the kernel."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from shapechanger.contract.plan import SensorPlan
from shapechanger.errors import RobotError, translate_errors
from shapechanger.robot.drivers.chip import FilePath, Keys, SensorChip, device_errors
from shapechanger.robot.hardware import Hardware

_PERIOD_NS: Final = 1_000_000_000


class CpuTemperatureKeys(Keys, frozen=True, kw_only=True):
    """Keys of the CPU's temperature.

    Attributes:
        path: File of the kernel with the temperature, thousandths of a degree Celsius.
    """

    path: FilePath = "/sys/class/thermal/thermal_zone0/temp"


class CpuTemperature:
    """Temperature in a kernel file; see `SensorDriver`."""

    def __init__(self, plan: SensorPlan, hardware: Hardware) -> None:
        self._path = Path(CpuTemperatureKeys.of(plan.settings).path)
        self._name = f"Sensor {plan.name!r}"
        self._read_ns: int | None = None
        self._celsius = self._measure()

    def read(self, now_ns: int, direction: float) -> dict[str, float]:
        """Return the "temperature" in degrees Celsius, updated at most once a second."""
        if self._read_ns is None or now_ns - self._read_ns >= _PERIOD_NS:
            self._celsius, self._read_ns = self._measure(), now_ns
        return {"temperature": self._celsius}

    def close(self) -> None:
        """Do nothing, because no file stays open."""

    def _measure(self) -> float:
        with device_errors(self._name):
            written = self._path.read_text()
        text = f"{self._name} read {written!r} at {self._path}, which is no temperature."
        with translate_errors(ValueError, to=lambda _: RobotError(text)):
            # Millidegrees: Documentation/driver-api/thermal/sysfs-api.rst of the kernel.
            return int(written) / 1000.0


CPU_TEMPERATURE: Final = SensorChip(
    measures="temperature", keys=CpuTemperatureKeys, open=CpuTemperature
)
