"""`shapechanger robot`: set up, serve, find, drive and test robots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import tyro

from shapechanger.cli.robot.calibrate import Calibrate
from shapechanger.cli.robot.camera import CameraView
from shapechanger.cli.robot.check import CheckRobot
from shapechanger.cli.robot.drive import Drive
from shapechanger.cli.robot.key import Key
from shapechanger.cli.robot.remote import FetchEpisodes, Find, Forget, Remember, Stop
from shapechanger.cli.robot.serve import Serve
from shapechanger.cli.robot.setup import Home, Init, Install, SafePins

__all__ = ["Robot"]


@dataclass(frozen=True)
class Robot:
    """Set up, serve, find, drive and test robots."""

    command: (
        Annotated[Init, tyro.conf.subcommand("init")]
        | Annotated[Install, tyro.conf.subcommand("install")]
        | Annotated[CheckRobot, tyro.conf.subcommand("check")]
        | Annotated[Calibrate, tyro.conf.subcommand("calibrate")]
        | Annotated[CameraView, tyro.conf.subcommand("camera")]
        | Annotated[Home, tyro.conf.subcommand("home")]
        | Annotated[Serve, tyro.conf.subcommand("serve")]
        | Annotated[Key, tyro.conf.subcommand("key")]
        | Annotated[Find, tyro.conf.subcommand("find")]
        | Annotated[Remember, tyro.conf.subcommand("remember")]
        | Annotated[Forget, tyro.conf.subcommand("forget")]
        | Annotated[Drive, tyro.conf.subcommand("drive")]
        | Annotated[FetchEpisodes, tyro.conf.subcommand("fetch")]
        | Annotated[Stop, tyro.conf.subcommand("stop")]
        | Annotated[SafePins, tyro.conf.subcommand("safe-pins")]
    )
