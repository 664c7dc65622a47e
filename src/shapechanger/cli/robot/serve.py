"""`shapechanger robot serve`: run a robot on its hardware or on a twin."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Annotated, Final

import msgspec
import tyro

from shapechanger.cli.console import say
from shapechanger.cli.robot.setup import require_port
from shapechanger.errors import (
    MissingExtra,
    RobotError,
    check_seed,
)
from shapechanger.robot.check.pins import require_pins
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.running import command_of, plan_fd
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.serve import Service, require_free
from shapechanger.robot.twin.start import Place
from shapechanger.vehicles.remote.pilot import require_policies

_ROOM: Final = "room"


@dataclass(frozen=True, kw_only=True)
class RobotServe(Service):
    """Run a robot's guard and daemon, on its hardware or on a twin."""

    profile: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="PROFILE")]
    """A profile, such as car.toml, or the name of one that comes with Shapechanger."""
    world: str = ""
    """With --twin: corridor, yard, harbour or flooded-corridor; or room, which works without
    MuJoCo. The vehicle's default if not given."""
    lens: tuple[str, ...] = ()
    """With --twin: disturbances of the camera, such as night or dirt."""
    gap: str = ""
    """With --twin, for a finger: name of the gap that it is drawn from, such as real-like; the
    nominal finger if not given."""
    finger_seed: int | None = None
    """With --gap: seed of the finger drawn from the gap, like finger_seed of Finger-v1."""

    def run(self) -> None:
        """Become the robot's supervisor, and never return; raise if it cannot be started."""
        self._refuse_contradictions()
        profile = load_profile(find_profile(self.profile))
        # `undo` runs only after an error: after `exec`, the supervisor keeps all resources.
        with contextlib.ExitStack() as undo:
            board = None
            if self.twin:
                place = partial(
                    place_of, profile, self.world, self.lens, self.gap, self.finger_seed
                )
                board = self.board(profile, place, undo)
            plan = self.plan(profile, board)
            if self.policy is not None:
                require_policies(self.policy, msgspec.convert(plan.daemon, DaemonPlan).card)
            if board is None:
                require_pins(profile.guard_plan())
            port = require_free(str(plan.daemon["host"]), self.port)
            with contextlib.suppress(OSError):  # A full disk loses messages, not the robot.
                if board is not None:
                    say(f"twin of {profile.name}: ledger {board.ledger_path}")
                    if known := self.make_known(profile.name, plan, port):
                        say(known)
                sys.stdout.flush()
            # `exec` frees the modules that this process has loaded and a supervisor does not need.
            command = [*command_of("supervise", plan), "--plan-fd", str(plan_fd(plan))]
            os.execv(plan.python, command)

    def _refuse_contradictions(self) -> None:
        """Refuse options of a twin without --twin, conflicting options, and invalid numbers."""
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
                raise RobotError(f"{option} needs --twin.")
        for seed in (self.seed, self.finger_seed or 0):
            check_seed(seed, RobotError)
        if self.finger_seed is not None and not self.gap:
            raise RobotError("--finger-seed needs --gap.")
        if self.gap and self.world:
            raise RobotError("Give --gap or --world, not both.")
        require_port(self.port)


def place_of(
    profile: Profile, world: str, lenses: Sequence[str], gap: str = "", seed: int | None = None
) -> Place:
    """Return the world of a twin: a plain room, a kind of course, or a finger's rig.

    `world` is "room" for the plain room, or "" for the robot's default. If the robot has no
    default, or MuJoCo is not installed, "" also selects the room unless a `gap` is given.
    """
    if world == _ROOM or not (world or gap or find_spec("mujoco")):
        if lenses:
            raise RobotError("--lens has no effect in the plain room: choose another --world.")
        return Place()
    if gap and not find_spec("mujoco"):
        raise MissingExtra("mujoco", "sim")
    if gap or not (world or lenses):
        from shapechanger.finger.twin import rig_place  # MuJoCo, an extra.

        if (rig := rig_place(profile, gap, seed)) is not None:
            return rig
    from shapechanger.vehicles.twin import place_of as course_of  # MuJoCo.

    return course_of(profile, world, lenses)
