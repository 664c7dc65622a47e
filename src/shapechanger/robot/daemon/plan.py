"""Settings of the daemon, which the command line passes on."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.link.address import DEFAULT_PORT
from shapechanger.robot.link.card import RobotCard


class DaemonPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the daemon. They are checked when the fields of a `ServePlan` are converted."""

    card: RobotCard
    camera: CameraPlan | None = None
    host: str = "127.0.0.1"  # Address to listen at.
    # Port to listen at; 0 for any free port.
    port: Annotated[int, Meta(ge=0, le=65535)] = DEFAULT_PORT
    credentials: str = ""  # Folder of the robot's key and certificate; "" for none, and no TLS.
    insecure: bool = False  # Whether to serve without TLS, also to other machines.
    discovery: bool = True  # Whether to announce the robot on the local network.
    ready_file: str = ""  # File for the port and the fingerprint, as JSON; "" for none.
    recordings: str = ""  # Folder of the recorded episodes; "" for none.
    policies: str = ""  # Folder of the policies that may run on the robot's computer; "" for none.
    policy: str = ""  # Name of the policy that starts with the robot; "" for none.
    pilot: str = ""  # Module of the program that runs a policy; "" for none.
