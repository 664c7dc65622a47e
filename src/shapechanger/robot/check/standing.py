"""A robot that stands still while its computer, settings and wires are checked."""

from __future__ import annotations

import importlib.util
import os
import socket
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from shapechanger.contract.plan import GuardPlan, SensorPlan
from shapechanger.robot.cameras.camera import Camera, CameraPlan, open_camera
from shapechanger.robot.check.check import CHECK_S
from shapechanger.robot.hardware import Hardware, RealHardware
from shapechanger.robot.profile.profile import Profile


@dataclass(frozen=True)
class StandingRobot:
    """A robot that is not driven.

    Attributes:
        guard: Outputs, sensors and limits of the robot.
        camera: Its camera, or None.
        port: Port of its server.
        root: Root of the file system.
        look: Opens the camera.
        unit_of: The profile that its systemd unit must name; None to skip the name.
        hardware: Opens its pins and buses.
        motors_off: Whether the motors have no supply, so that their resistors can be tested.
        limit_s: Time for each check, s.
        installed: Whether it is installed on its computer, and not on a bench with LEDs.
        on_twin: Whether it is a twin, whose computer has all pins and buses and no settings.
        profile: The profile, for checks of it and of its credentials; None for neither.
        credentials: Folder of its key and certificate; None for that of `init`.
    """

    guard: GuardPlan
    camera: CameraPlan | None = None
    port: int = 0
    root: Path = Path("/")
    look: Callable[[CameraPlan], Camera] = open_camera
    unit_of: Path | None = None
    hardware: Callable[[], Hardware] = RealHardware
    motors_off: bool = False
    limit_s: float = CHECK_S
    installed: bool = True
    on_twin: bool = False
    profile: Profile | None = None
    credentials: Path | None = None

    @cached_property
    def pins(self) -> Hardware:
        """Its pins and buses, opened once."""
        return self.hardware()

    @cached_property
    def port_error(self) -> str:
        """Why its port cannot be used; "" if it can."""
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("", self.port))
            except OSError as error:
                return f"{error.strerror}"
        return ""

    @property
    def has_pins(self) -> bool:
        """Whether its computer has pins."""
        return self.on_twin or any((self.root / "dev").glob("gpiochip*"))

    def has_bus(self, bus: int) -> bool:
        """Return whether this user may open an I2C bus."""
        return self.on_twin or os.access(self.root / f"dev/i2c-{bus}", os.R_OK | os.W_OK)

    def can_read(self, sensor: SensorPlan) -> bool:
        """Return whether what a sensor is wired to is there."""
        if "bus" in sensor.settings:
            return self.has_bus(sensor.settings["bus"])
        return self.has_pins or sensor.driver == "cpu_temperature"

    @property
    def is_free(self) -> bool:
        """Whether its pins and buses can be opened; where it is served, its guard has them."""
        return not self.port_error and importlib.util.find_spec("gpiozero") is not None


def servo_enables(guard: GuardPlan) -> list[int]:
    """Return the pins at OE of servo boards."""
    boards = [one.settings for one in guard.outputs if one.settings.get("over") == "pca9685"]
    return sorted({one["output_enable"] for one in boards} - {-1})
