"""What the daemon needs to know, as the command line hands it over."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from shapechanger.errors import ProfileError
from shapechanger.link.address import DEFAULT_PORT
from shapechanger.robot.cameras.camera import CameraPlan

__all__ = ["DaemonPlan"]


class DaemonPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Everything that the daemon needs, checked by type when it is read.

    Attributes:
        robot: Name of the robot.
        body: What it is, such as "car".
        action_layout: JSON of the `Layout` of a command's values.
        state_layout: JSON of the `Layout` of an observation's state. A feature is filled from the
            quantity of the guard of the same name; from the action of the same name for
            "NAME/applied"; with NaN where nothing measures it.
        camera: The camera; None without one.
        control_hz: How many commands a second the robot expects.
        tick_hz: How often the guard looks at its rules.
        deadline_ms: How long the newest command acts at most; the guard enforces it.
        max_observation_age_ms: How old an observation may be that a command answers.
        reward: Weights of the task by name.
        reset: Commands that bring the robot back, and how many seconds each lasts.
        arming: Who may arm it.
        clock: Where its time comes from.
        host: Address to listen at.
        port: Port to listen at; 0 for any that is free.
        certificate: File of the certificate (PEM); "" for no TLS.
        private_key: File of its private key (PEM).
        key_file: File of the key that clients must hold; "" for none.
        insecure: Whether somebody asked in so many words to listen beyond this machine without TLS
            or a key.
        discovery: Whether to announce the robot on the local network.
        ready_file: File that tells the port once it is known; "" for none.
        recordings: Folder for what is recorded; "" for none.
    """

    robot: Annotated[str, Meta(min_length=1, max_length=64)]
    body: str
    action_layout: str
    state_layout: str
    camera: CameraPlan | None = None
    control_hz: Annotated[float, Meta(gt=0.0, le=100_000.0)] = 20.0
    tick_hz: Annotated[float, Meta(gt=0.0)] = 100.0
    deadline_ms: Annotated[int, Meta(ge=1)] = 250
    max_observation_age_ms: Annotated[int, Meta(ge=1)] = 400
    reward: dict[str, float] = {}
    reset: tuple[tuple[tuple[float, ...], float], ...] = ()
    arming: Literal["person", "anyone"] = "person"
    clock: Literal["real", "twin"] = "real"
    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)] = DEFAULT_PORT
    certificate: str = ""
    private_key: str = ""
    key_file: str = ""
    insecure: bool = False
    discovery: bool = True
    ready_file: str = ""
    recordings: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The plan as what JSON can hold."""
        return msgspec.to_builtins(self)

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> DaemonPlan:
        """Read what `to_dict` gave.

        Raises:
            ProfileError: If it is no plan.
        """
        try:
            return msgspec.convert(fields, cls)
        except msgspec.ValidationError as error:
            raise ProfileError(f"This is no plan for a daemon: {error}.") from error
