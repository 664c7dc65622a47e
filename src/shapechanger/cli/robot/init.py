"""`shapechanger robot init | home`: create a robot's files, and find a rig's zeros."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError


@dataclass(frozen=True)
class Init:
    """Create the profile, key and certificate of a new robot."""

    kind: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="KIND")]
    """Name of a shipped profile, such as car."""
    name: str = ""
    """Name of the robot; that of its kind if not given."""
    out: Path | None = None
    """The profile to write; NAME.toml if not given."""
    credentials: Path | None = None
    """Folder for the key and the certificate, if not the robot's own in the user's
    configuration."""

    def run(self) -> None:
        """Write the files and print the next steps."""
        from shapechanger.cli.robot.key import how_to_remember, shown_credentials
        from shapechanger.cli.robot.serve import credentials_of
        from shapechanger.link.authentication import fingerprint_hex
        from shapechanger.remote.known_robots import KnownRobot, check_name, remember
        from shapechanger.robot.profile.load import starter_text, write_profile
        from shapechanger.robot.setup.systemd import write_unit

        name = self.name or self.kind
        check_name(name)
        out = self.out or Path(f"{name}.toml")
        starter_text(self.kind, out, name)  # Check everything before creating anything.
        credentials = credentials_of(name, self.credentials, make=True)
        key = credentials.key_file.read_text().strip()
        digits = fingerprint_hex(credentials.fingerprint)
        # Lets this machine drive it, especially on a twin.
        remember(KnownRobot(name, "127.0.0.1", key, digits))
        unit, is_new = write_unit(name, out, self.credentials)
        # Last, because an existing profile is refused: after a failure, such as a full disk, the
        # command can be repeated.
        profile = write_profile(self.kind, out, name)
        console = plain_console()
        console.print(
            f"wrote {profile}: look at its pins before anything moves\n"
            f"{'wrote' if is_new else 'kept'} {unit}: for systemd, see docs/hardware.md\n"
            f"key and certificate in {credentials.key_file.parent}\n\n"
            f"{shown_credentials(credentials)}\n\n"
            f"Next: shapechanger robot doctor {profile}\n"
            f"      shapechanger robot serve {profile}   (with --twin: without any hardware)\n"
            f"{how_to_remember(name, credentials)}",
            soft_wrap=True,
        )


_CYCLE_S: Final = 0.01


@dataclass(frozen=True)
class Home:
    """Find the zeros of a rig's tendons and joints while a person holds the finger straight."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The rig's profile; the zeros are written into it, and its comments stay. The rig must not be
    served meanwhile. Do it again whenever the servos were without power; encoders at the joints
    keep their zeros."""
    straight: bool = False
    """Somebody holds the finger straight already, so do not ask."""

    def run(self) -> None:
        """Pull gently and store the positions at which motion stops."""
        from shapechanger.robot.hardware import REAL, connect
        from shapechanger.robot.profile.edit import rewrite
        from shapechanger.robot.profile.load import find_profile, load_profile, shipped_profiles
        from shapechanger.robot.setup.zeros import find_joint_zeros, find_zeros

        path = find_profile(self.profile)
        if path in shipped_profiles().values():
            raise RobotError(
                f"{path.stem} comes with Shapechanger and is not changed: "
                f"`shapechanger robot init {path.stem}` writes one of your own."
            )
        plan = load_profile(path).guard_plan()
        console = plain_console()
        if not self.straight:
            words = "All tendons pull gently. Hold the finger straight, and press Enter. "
            console.input(words)
        hardware = connect(REAL, "")
        try:
            zeros = find_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
            joints = find_joint_zeros(plan, hardware, lambda: time.sleep(_CYCLE_S))
        finally:
            hardware.close()
        found = {f"output.{name}.zero": zero for name, zero in zeros.items()}
        found |= {f"sensor.{name}.zero": zero for name, zero in joints.items()}
        rewrite(path, found)
        for name, zero in found.items():
            console.print(f"{name} = {zero}")
        console.print(f"wrote {path}")
