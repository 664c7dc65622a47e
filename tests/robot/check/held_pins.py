"""Mock pins that keep their level when they are closed, and shipped robots."""

from typing import Any

from gpiozero.pins.mock import MockFactory, MockPin, MockPWMPin

from shapechanger.robot.hardware import Hardware
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile


def shipped(kind: str) -> Profile:
    return load_profile(find_profile(kind))


class HeldPins(Hardware):
    """gpiozero's mock pins, which closing the hardware leaves as they are."""

    def __init__(self, kind: type[MockPin] = MockPWMPin) -> None:
        super().__init__()
        self.factory: Any = MockFactory(pin_class=kind)

    def pin_factory(self) -> Any:
        return self.factory

    def close(self) -> None:
        """Do nothing, so the mock pins stay open."""
