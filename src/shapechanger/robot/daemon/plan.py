"""Settings of the daemon, as the command line passes them on."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from shapechanger.errors import ProfileError
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.link.address import DEFAULT_PORT


class DaemonPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the daemon, type-checked when they are read.

    Attributes:
        robot: Name of the robot.
        body: Kind of robot, such as "car".
        action_layout: JSON of the `Layout` of a command's values.
        state_layout: JSON of the `Layout` of an observation's state. A feature takes the
            value of the guard's quantity of the same name, "NAME/applied" that of the applied
            action NAME, and NaN where no sensor measures it.
        camera: Settings of the camera; None without one.
        control_hz: Commands per second that the robot expects.
        tick_hz: Rate of the guard, Hz.
        slew_per_s: Fastest change of each action away from rest, 1/s; 0 for no limit.
        slew_down_per_s: Fastest change of each action towards rest, 1/s; 0 for no limit.
        deadline_ms: Longest time that a command acts, ms; the guard enforces it.
        max_observation_age_ms: Oldest observation that a command may answer, ms.
        reward: Weights of the task, by name.
        reset: Commands that return the robot to the start, each with its duration, s.
        arming: Who may arm the robot.
        clock: Source of the robot's time.
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
        turning: Turn at full steering, rad for each metre and for each second; None if not
            measured.
    """

    robot: Annotated[str, Meta(min_length=1, max_length=64)]
    body: str
    action_layout: str
    state_layout: str
    camera: CameraPlan | None = None
    control_hz: Annotated[float, Meta(gt=0.0, le=100_000.0)] = 20.0
    tick_hz: Annotated[float, Meta(gt=0.0)] = 100.0
    slew_per_s: tuple[float, ...] = ()
    slew_down_per_s: tuple[float, ...] = ()
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
    policies: str = ""
    policy: str = ""
    pilot: str = ""
    turning: tuple[float, float] | None = None

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
