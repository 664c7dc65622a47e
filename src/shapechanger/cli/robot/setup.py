"""`shapechanger robot init | install | key`: set up a robot."""

from __future__ import annotations

import getpass
import socket
import sys
from contextlib import suppress
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro
from rich.prompt import Prompt

from shapechanger.cli.console import plain_console, say
from shapechanger.errors import RobotError, UnknownName, needing_extra
from shapechanger.robot.client.known_robots import check_name, console_address, remember
from shapechanger.robot.daemon.credentials import (
    Credentials,
    credentials_folder,
    load_credentials,
    make_credentials,
)
from shapechanger.robot.link.authentication import fingerprint_short
from shapechanger.robot.profile.load import (
    find_profile,
    load_profile,
    profile_text,
    rewrite,
    shipped_profiles,
    starter_text,
    write_profile,
)
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.serve import robot_at
from shapechanger.robot.setup.install import (
    Machine,
    changes_to_install,
    changes_to_remove,
    make_changes,
    unit_name,
    unit_word,
    write_unit,
)


@dataclass(frozen=True)
class RobotInit:
    """Create a new robot's profile, key and certificate; without arguments, ask at the terminal."""

    kind: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[KIND]")] = ""
    """Name of a shipped profile, such as car. Without any argument, the command asks up to five
    questions at a terminal."""
    name: str = ""
    """Name of the robot; the kind if not given."""
    out: Path | None = None
    """The profile to write; NAME.toml if not given."""
    credentials: Path | None = None
    """Folder for the key and the certificate; a folder in the user's configuration if not given."""
    camera: Literal["", "ribbon", "usb", "none"] = ""
    """The camera: on the Pi's ribbon cable, a webcam, or none; the kind's default if not given."""
    arming: Literal["", "person", "anyone"] = ""
    """Who may arm it: only a person, or programs, too; the kind's default if not given."""

    def run(self) -> None:
        if self == RobotInit() and sys.stdin.isatty():
            self._ask()
            return
        if not self.kind:
            raise RobotError(
                "Name the kind of the new robot, such as `shapechanger robot init car`. There are: "
                f"{', '.join(shipped_profiles())}."
            )
        self._write()

    def _ask(self) -> None:
        """Ask for kind, name, camera and arming, write the files, and offer to install on a Pi."""
        console, kinds = plain_console(), shipped_profiles()
        say("Kinds of robot:")
        for kind, path in kinds.items():
            # The first sentence of the comment at the head of the profile.
            head = takewhile(lambda line: line.startswith("#"), profile_text(path).splitlines())
            summary = " ".join(line.lstrip("# ") for line in head).partition(". ")[0].rstrip(".")
            say(f"  {kind:10}  {summary}")

        def ask(question: str, default: str, *choices: str) -> str:
            return Prompt.ask(
                question, console=console, choices=[*choices] or None, default=default
            )

        try:
            kind = ask("Kind of robot", "car", *kinds)
            stated = load_profile(kinds[kind])
            name = ask("Its name", kind)
            has = "none" if stated.camera is None else "ribbon"
            question = "Camera (ribbon: the Pi's own cable, usb: a webcam)"
            camera = ask(question, has, "ribbon", "usb", "none")
            question = "Who may arm it, so that it can move (anyone: programs, too)"
            arming = ask(question, stated.arming, "person", "anyone")
            installs = False
            with suppress(RobotError):
                Machine("").require_pi()
                question = "Install it now, with sudo, to start with the computer"
                installs = ask(question, "yes", "yes", "no") == "yes"
        except EOFError:
            raise RobotError("No more answers: no file was written.") from None
        chosen: Any = {
            "camera": "" if camera == has else camera,
            "arming": "" if arming == stated.arming else arming,
        }
        made = RobotInit(kind, name, **chosen)._write(installs=installs)
        if installs:
            say("")
            RobotInstall(str(made)).run()

    def _write(self, *, installs: bool = False) -> Path:
        name = self.name or self.kind
        check_name(name)
        out = self.out or Path(f"{name}.toml")
        # Check everything before creating anything.
        starter_text(self.kind, out, name, self.camera, self.arming)
        credentials = make_credentials(self.credentials or credentials_folder(name), name)
        # Lets clients on this machine drive the robot, especially a twin.
        remember(robot_at("127.0.0.1", name, credentials))
        unit, is_new = write_unit(name, out, self.credentials)
        # The profile is written last, because an existing one is refused: after a failure, such as
        # a full disk, the command can be repeated.
        profile = write_profile(self.kind, out, name, self.camera, self.arming)
        say(
            f"wrote {profile}: check its pins before anything moves\n"
            f"{'wrote' if is_new else 'kept'} {unit}: its systemd unit\n"
            f"key and certificate in {credentials.folder}\n\n"
            f"{shown_credentials(name, credentials)}\n"
        )
        if not installs:
            say(
                f"Next: shapechanger robot install {profile}   "
                "(on the Pi: service, groups, buses)\n"
                f"      shapechanger robot check {profile} --wiring\n"
                f"      shapechanger robot serve {profile}   (with --twin: without any hardware)"
            )
        return profile


@dataclass(frozen=True)
class RobotKey:
    """Show the key and fingerprint of a robot that was set up on this machine."""

    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")]
    """Name of the robot."""
    credentials: Path | None = None
    """Folder of the robot's key and certificate; by default the one that `robot init` made."""
    qr: bool = False
    """Show a QR code that opens the console on a phone. It contains the key, so keep it private."""
    address: str = ""
    """With --qr: address of the robot for the phone, HOST or HOST:PORT; by default this machine's
    name."""

    def run(self) -> None:
        folder = self.credentials or credentials_folder(self.name)
        if not folder.exists() and self.credentials is None:
            there = folder.parent.iterdir() if folder.parent.is_dir() else ()
            raise UnknownName(
                "robot of this machine", self.name, sorted(path.name for path in there)
            )
        credentials = load_credentials(folder)
        say(shown_credentials(self.name, credentials))
        if not self.qr:
            return
        with needing_extra("robot"):
            import segno

        robot = robot_at(self.address or f"{socket.gethostname()}.local", self.name, credentials)
        console = console_address(robot)
        say(f"\nThe console is at {console}; scan this code to open it on a phone:\n")
        # Printed verbatim: wrapping would break the code.
        segno.make(f"{console}#key={robot.key}", micro=False).terminal(sys.stdout, compact=True)


def shown_credentials(name: str, credentials: Credentials) -> str:
    """Return a text with the key, the fingerprint, and how to enter them on a workstation."""
    fingerprint = credentials.fingerprint
    return (
        f"key          {credentials.key}\n"
        f"fingerprint  {fingerprint.hex()}\n"
        f"in short     {fingerprint_short(fingerprint)}\n\n"
        "On the workstation, with the key from above:\n"
        f"      shapechanger robot remember {name} {socket.gethostname()}.local "
        f"--fingerprint {fingerprint.hex()}"
    )


def own_profile(name: str) -> Path:
    """Return the file of a profile that may be changed, from its path or name."""
    path = find_profile(name)
    if path in shipped_profiles().values():
        own = Path(path.name)
        remedy = f"`shapechanger robot init {path.stem}` writes your own"
        if own.is_file():
            remedy = f"{own} in this folder is your own"
        raise RobotError(f"{path.stem} comes with Shapechanger and is not changed: {remedy}.")
    return path


def change_profile(path: Path, changes: dict[str, Any]) -> None:
    """Write changes into a profile, and print them."""
    rewrite(path, changes)
    for name, value in changes.items():
        say(f"{name} = {value}")
    say(f"wrote {path}")


@dataclass(frozen=True)
class RobotInstall:
    """Install a robot's service, and set up its groups, buses and camera, on a Raspberry Pi."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """The robot's profile, which `robot init` wrote."""
    dry_run: bool = False
    """Only print the changes and their commands."""
    remove: bool = False
    """Remove the service; groups and settings of the computer are kept."""
    credentials: Path | None = None
    """Folder of the robot's key and certificate; by default the one that `robot init` made."""

    def run(self) -> None:
        self.install(load_profile(own_profile(self.profile)), Machine(getpass.getuser()))

    def install(self, profile: Profile, machine: Machine) -> None:
        """Make the changes on a machine, or only print them; exit with 1 if a change fails."""
        if self.remove:
            machine.require_systemd()
            changes = changes_to_remove(unit_name(profile.name), machine.root)
        else:
            machine.require_pi()
            if machine.user == "root":
                raise RobotError(
                    "Run this without sudo, as the user that will run the robot: the command calls "
                    "sudo when needed."
                )
            folder = self.credentials or credentials_folder(profile.name)
            load_credentials(folder)
            unit = self._unit(profile, machine.user)
            changes = changes_to_install(profile, unit, machine)
        restarts, failed = False, 0
        for change, level, sentence in make_changes(changes, machine.run, dry=self.dry_run):
            say(f"{level:7}  {change.name}: {sentence}")
            restarts |= change.restarts and level in {"did", "would"}
            failed += level == "FAILED"
        if restarts:
            say("Restart the computer, which sets up groups, pins and buses: sudo reboot")
        if failed:
            say(f"\n{failed} could not be done.")
            sys.exit(1)
        if not (self.remove or self.dry_run):
            unit = unit_name(profile.name).removesuffix(".service")
            say(
                f"\nNext: shapechanger robot check {profile.path} --wiring\n"
                f"      sudo systemctl start {unit}   (restart, if it runs already)"
            )

    def _unit(self, profile: Profile, user: str) -> Path:
        path = profile.path.absolute()
        unit = path.parent / unit_name(profile.name)
        if not unit.exists() and self.dry_run:
            # Usually `robot init` has written the unit. With --dry-run, no file may be written.
            raise RobotError(f"{unit} does not exist; without --dry-run, this command writes it.")
        unit, _ = write_unit(profile.name, path, self.credentials, user)
        text = unit.read_text(errors="replace")
        if unit_word(str(path)) not in text or f"\nUser={user}\n" not in text:
            raise RobotError(
                f"{unit} does not run {path} as {user}, who installs it: remove it, and install "
                "again."
            )
        return unit


_LAST_PORT: Final = 65535


def require_port(port: int) -> None:
    """Refuse a number that is not a TCP port; 0 selects any free port."""
    if not 0 <= port <= _LAST_PORT:
        raise RobotError(f"A port must be 0 (any free port) to {_LAST_PORT}, got {port}.")
