"""Another teleoperator of LeRobot: a stick that always points ahead."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig


@TeleoperatorConfig.register_subclass("stick")
@dataclass(kw_only=True)
class StickConfig(TeleoperatorConfig):
    """Configuration of the stick.

    Attributes:
        throttle: Throttle of each action, 0 to 1.
    """

    throttle: float = 0.3


class Stick(Teleoperator):
    """A stick that always points ahead."""

    config_class = StickConfig
    name = "stick"
    action_features: dict[str, type] = {"steering": float, "throttle": float}  # noqa: RUF012
    feedback_features: dict[str, type] = {}  # noqa: RUF012
    is_connected = is_calibrated = True

    def __init__(self, config: StickConfig) -> None:
        super().__init__(config)
        self.config = config

    def connect(self, calibrate: bool = True) -> None:
        """Do nothing."""

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing."""

    def get_action(self) -> dict[str, float]:
        """Return the action: straight ahead with this throttle."""
        return {"steering": 0.0, "throttle": self.config.throttle}

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Do nothing."""
