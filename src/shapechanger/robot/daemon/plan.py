"""Settings of the daemon, as the command line passes them on."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
from msgspec import Meta

from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.link.address import DEFAULT_PORT
from shapechanger.robot.link.card import RobotCard

if TYPE_CHECKING:  # The daemon needs no profile.
    from shapechanger.robot.profile.profile import Profile


class DaemonPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the daemon, type-checked when they are read.

    Attributes:
        card: Facts of the robot.
        camera: Settings of the camera; None without one.
        host: Address to listen at.
        port: Port to listen at; 0 for any free port.
        certificate: File of the certificate (PEM); "" for no TLS.
        private_key: File of its private key (PEM).
        key_file: File of the key that clients must hold; "" for none.
        insecure: Whether to serve other machines without TLS or a key.
        discovery: Whether to announce the robot on the local network.
        ready_file: File that the port is written to; "" for none.
        recordings: Folder of the recorded episodes; "" for none.
        policies: Folder of the policies that may drive on board; "" for none.
        policy: Name of the one that starts with the robot; "" for none.
        pilot: Module of the program that runs one of them; "" for none.
    """

    card: RobotCard
    camera: CameraPlan | None = None
    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)] = DEFAULT_PORT
    certificate: str = ""
    private_key: str = ""
    key_file: str = ""
    insecure: bool = False
    discovery: bool = True
    ready_file: str = ""
    recordings: str = ""
    policies: str = ""
    policy: str = ""
    pilot: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as values that JSON can hold."""
        return msgspec.to_builtins(self)

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> DaemonPlan:
        """Read the output of `to_dict`.

        Raises:
            ProfileError: If a field is unknown or has the wrong type or range.
        """
        try:
            return msgspec.convert(fields, cls)
        except msgspec.ValidationError as error:
            raise ProfileError(f"Invalid daemon plan: {error}.") from error


def card_of(
    profile: Profile,
    *,
    arming: Literal["", "anyone"] = "",
    clock: Literal["real", "twin"] = "real",
    pictures: bool = True,
) -> RobotCard:
    """Return the card of a robot.

    Args:
        profile: The robot.
        arming: Who may arm it, in place of the profile's; "" for the profile's.
        clock: Source of its time.
        pictures: Whether its camera is used.
    """
    camera = profile.camera if pictures else None
    return RobotCard(
        robot=profile.name,
        body=profile.body,
        action_layout=profile.action_layout().to_json(),
        state_layout=profile.state_layout().to_json(),
        image_size=None if camera is None else camera.size,
        camera_pitch_deg=None if camera is None else camera.pitch_deg,
        camera_fovy_deg=None if camera is None else camera.fovy_deg,
        control_hz=profile.control_hz,
        tick_hz=profile.tick_hz,
        slew_per_s=tuple(_limit(action.slew_per_s) for action in profile.actions),
        slew_down_per_s=tuple(_limit(action.slew_down_per_s) for action in profile.actions),
        deadline_ms=profile.limits.deadline_ms,
        max_observation_age_ms=profile.max_observation_age_ms,
        reward=profile.reward,
        reset=profile.reset,
        arming=arming or profile.arming,
        clock=clock,
        turning=profile.turning,
    )


def _limit(slew_per_s: float) -> float:
    """Return a slew as JSON can hold it: 0 for no limit."""
    return slew_per_s if math.isfinite(slew_per_s) else 0.0
