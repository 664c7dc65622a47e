"""Settings of the daemon, which the command line passes on."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.link.address import DEFAULT_PORT
from shapechanger.robot.link.card import RobotCard


class DaemonPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the daemon. They are checked when the fields of a `ServePlan` are converted.

    Attributes:
        card: Facts of the robot.
        camera: Settings of the camera; None without a camera.
        host: Address to listen at.
        port: Port to listen at; 0 for any free port.
        credentials: Folder of the robot's key and certificate; "" for none, and no TLS.
        insecure: Whether to serve without TLS, also to other machines.
        discovery: Whether to announce the robot on the local network.
        ready_file: File that the port is written to; "" for none.
        recordings: Folder of the recorded episodes; "" for none.
        policies: Folder of the policies that may run on the robot's computer; "" for none.
        policy: Name of the policy that starts with the robot; "" for none.
        pilot: Module of the program that runs a policy; "" for none.
    """

    card: RobotCard
    camera: CameraPlan | None = None
    host: str = "127.0.0.1"
    port: Annotated[int, Meta(ge=0, le=65535)] = DEFAULT_PORT
    credentials: str = ""
    insecure: bool = False
    discovery: bool = True
    ready_file: str = ""
    recordings: str = ""
    policies: str = ""
    policy: str = ""
    pilot: str = ""
