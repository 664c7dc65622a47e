"""`shapechanger robot serve`: the robot's own command, on its hardware or on a twin."""

from __future__ import annotations

import contextlib
import os
import shutil
import socket
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

import tyro

from shapechanger.cli.console import plain_console
from shapechanger.errors import RobotError

if TYPE_CHECKING:
    from shapechanger.robot.profile.profile import Profile
    from shapechanger.twin.start import BoardAt

__all__ = ["Serve"]

_LAST_PORT: Final = 65535
_HERE: Final = "127.0.0.1"


@dataclass(frozen=True)
class Serve:
    """Serve a robot to programs and people, and keep it safe."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """A profile, such as car.toml, or the name of one that comes with Shapechanger."""
    twin: bool = False
    """Run on simulated pins and in a simulated world in place of this machine's pins. It is then
    known here by its name, unless another robot is."""
    host: str = ""
    """Address to listen at; all of this machine's if not given, only 127.0.0.1 with --twin or
    --insecure."""
    port: int = 5000
    """Port to listen at; 0 for any that is free."""
    clock: Literal["real", "twin"] = "real"
    """With --twin: whether time passes by itself, or only when a program takes a step."""
    wired_as: str = ""
    """With --twin: the profile of what is really attached to the pins, if not the one served."""
    seed: int = 0
    """With --twin: seed of the world."""
    world: str = ""
    """With --twin: corridor, yard or harbour, or room for a plain room that needs no MuJoCo; where
    the vehicle is at home if not given."""
    lens: tuple[str, ...] = ()
    """With --twin: what is wrong with the camera, such as night or dirt."""
    gap: str = ""
    """With --twin, for a finger: what the finger is drawn from, such as real-like; the nominal one
    if not given."""
    finger_seed: int | None = None
    """With --gap: which finger of it this is, as finger_seed of Finger-v1."""
    twin_folder: Path | None = None
    """With --twin: folder for the ledger of all pins and the twin's socket; a new one if not
    given. A twin that runs there already is used as it is."""
    insecure: bool = False
    """Speak without TLS. The key is still needed."""
    credentials: Path | None = None
    """Folder of the robot's key and certificate, if not the one that `init` made."""
    arm_by_program: bool = False
    """Let programs arm the robot. By default a person has to; on a twin anyone may."""
    announce: bool = True
    """Let `shapechanger robot find` find it."""
    ready_file: Path | None = None
    """File to write the port and the fingerprint into, as JSON, once the robot can be reached."""

    recordings: Path | None = None
    """Folder for what is recorded on the robot; ~/.local/share/shapechanger/recordings/NAME if not
    given."""

    def run(self) -> None:
        """Become the robot's supervisor; this returns only with an error."""
        from shapechanger.cli.robot.pins_here import require_pins
        from shapechanger.cli.robot.serving import ServeOptions, serve_plan
        from shapechanger.robot.guard.serve_plan import plan_fd, supervisor_command
        from shapechanger.robot.profile.load import find_profile, load_profile

        self._refuse_contradictions()
        profile = load_profile(find_profile(self.profile))
        # Whatever is undone is undone after an error only: the exec leaves everything as it is.
        with contextlib.ExitStack() as undo:
            board = self._board(profile, undo) if self.twin else None
            plan = serve_plan(
                profile,
                ServeOptions(
                    host=self.host,
                    port=self.port,
                    insecure=self.insecure,
                    credentials=self.credentials,
                    arm_by_program=self.arm_by_program,
                    announce=self.announce,
                    ready_file=self.ready_file,
                    recordings=self.recordings,
                ),
                board,
                self.clock,
            )
            if board is None:
                require_pins(profile.guard_plan())
            _require_free(str(plan.daemon["host"]), self.port)
            with contextlib.suppress(OSError):  # A full disk takes words away, and no robot.
                if board is not None:
                    plain_console().print(f"twin of {profile.name}: ledger {board.ledger_path}")
                    self._make_known(profile.name)
                sys.stdout.flush()
            # In place of this process, which has loaded much that a supervisor has no use for.
            os.execv(plan.python, supervisor_command(plan, plan_fd(plan)))

    def _make_known(self, name: str) -> None:
        """Let this machine drive the twin by its name, as `init` does, and say so.

        Raises:
            OutputError: If that cannot be written down.
        """
        from shapechanger.cli.robot.knowing import can_be_known, make_known
        from shapechanger.cli.robot.serving import credentials_of
        from shapechanger.link.address import Address
        from shapechanger.link.authentication import fingerprint_hex
        from shapechanger.remote.known_robots import KnownRobot

        # Who asks for any port, or no TLS, tells whoever drives how to reach it.
        if not self.port or self.insecure or not can_be_known(name):
            return
        credentials = credentials_of(name, self.credentials, make=False)
        host = _HERE if self.host in {"", "0.0.0.0", "::"} else self.host
        address = str(Address(host, self.port))
        key = credentials.key_file.read_text().strip()
        robot = KnownRobot(name, address, key, fingerprint_hex(credentials.fingerprint))
        plain_console().print(make_known(robot), soft_wrap=True)

    def _refuse_contradictions(self) -> None:
        """Refuse what has a meaning on a twin only."""
        asked = {
            "--clock twin": self.clock == "twin",
            "--wired-as": bool(self.wired_as),
            "--twin-folder": self.twin_folder is not None,
            "--seed": self.seed != 0,
            "--world": bool(self.world),
            "--lens": bool(self.lens),
            "--gap": bool(self.gap),
        }
        for option, given in asked.items():
            if given and not self.twin:
                raise RobotError(f"{option} means something with --twin only.")
        if self.finger_seed is not None and not self.gap:
            raise RobotError("--finger-seed says which finger of a --gap it is: give that, too.")
        if self.gap and self.world:
            raise RobotError("A finger of a --gap is in no --world: give one of them.")
        if not 0 <= self.port <= _LAST_PORT:
            raise RobotError(
                f"A port is 0, for any that is free, to {_LAST_PORT}: got {self.port}."
            )

    def _board(self, profile: Profile, undo: contextlib.ExitStack) -> BoardAt:
        """The twin's board: the one that runs in the folder, or a new one.

        Args:
            profile: The robot.
            undo: What takes back what was started here.

        Raises:
            RobotError: If it does not start, or runs on another clock.
        """
        from shapechanger.cli.robot.serving import TwinOptions, finger_of, place_of, start_twin
        from shapechanger.twin.start import find_board

        folder = self.twin_folder
        if folder is None:
            folder = Path(tempfile.mkdtemp(prefix="shapechanger-twin-"))
            undo.callback(shutil.rmtree, folder, ignore_errors=True)
        found = find_board(folder)
        if found is None:
            place = finger_of(profile, self.gap, self.finger_seed) if self.gap else None
            place = place or place_of(profile, self.world, self.lens)
            options = TwinOptions(folder, self.clock, self.wired_as, self.seed, place=place)
            started = undo.enter_context(start_twin(profile, options))
            started.outlive_exec()
            return started
        board, clock = found
        if clock != self.clock:
            raise RobotError(f"The twin in {folder} runs on --clock {clock}.")
        return board


def _require_free(host: str, port: int) -> None:
    """Refuse an address that cannot be listened at, before anything starts for it."""
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        with socket.socket(family, kind, protocol) as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind(address)
            listener.listen(1)
    except OSError as error:
        raise RobotError(
            f"{host} port {port} cannot be listened at: {error.strerror or error}. "
            "Does the robot run already?"
        ) from error
