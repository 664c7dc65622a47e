"""Operator of a twin: moves the vehicle, causes faults, presses buttons, and reads true states."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Concatenate, NamedTuple, ParamSpec, Self, TypeVar, get_type_hints

from shapechanger.errors import RobotError, WorldError, require_known, translate_errors
from shapechanger.robot.drivers.as5600 import Magnet, SimulatedJoints
from shapechanger.robot.drivers.hcsr04 import SimulatedHcsr04
from shapechanger.robot.drivers.servos.simulation import ServoFault
from shapechanger.robot.drivers.simulation import Levels
from shapechanger.robot.drivers.switch import SimulatedSwitch
from shapechanger.robot.twin.camera import CameraFault
from shapechanger.robot.twin.pin_board import PinBoard
from shapechanger.robot.twin.rpc import BoardClient, Slept

_P = ParamSpec("_P")
_R = TypeVar("_R")


class Whereabouts(NamedTuple):
    """True state of the vehicle.

    Attributes:
        x: Position along the x axis, m.
        y: Position along the y axis, m.
        heading: Angle from the x axis, rad, counter-clockwise seen from above.
        speed: Speed along the heading, m/s.
        travelled_m: Distance rolled by the wheels, m; it decreases while driving backward.
        bumped: Whether the bumper is pressed.
        distance_m: Free distance ahead of the nose, m.
        truth: Quantities that no sensor measures, such as the progress along a course, keyed by
            name.
        t: Time of the twin, ns.
    """

    x: float
    y: float
    heading: float
    speed: float
    travelled_m: float
    bumped: bool
    distance_m: float
    truth: dict[str, float]
    t: int


def _at_board(
    function: Callable[Concatenate[Operator, _P], _R],
) -> Callable[Concatenate[Operator, _P], _R]:
    """Decorate a method so that its body runs in the board's process, where `_board` is set."""

    @functools.wraps(function)
    def ask(self: Operator, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        given = inspect.signature(function).bind(self, *args, **kwargs)
        given.apply_defaults()
        kind = get_type_hints(function)["return"]
        client = self._client  # pyright: ignore[reportPrivateUsage]
        return client.ask(kind, function.__name__, *given.args[1:], *given.kwargs.values())

    return ask


class Operator:
    """A person next to the robot, who moves the vehicle, causes faults and presses buttons.

    Each request takes effect after all calls that the robot's processes have sent before it.

    Args:
        path: Socket on which the board listens.

    Raises:
        RobotError: If no board listens on the socket.
    """

    _client: BoardClient
    _board: PinBoard  # Set only in the board's process.

    def __init__(self, path: str) -> None:
        self._client = BoardClient(path, "operator")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def advance(self, seconds: float) -> int:
        """Advance the twin's clock and return its time, ns.

        Raises:
            RobotError: If the board runs in real time.
        """
        return self._client.ask(Slept, "sleep", round(seconds * 1e9)).t

    @_at_board
    def place(self, seed: int) -> None:
        """Place the vehicle at the start that a seed selects."""
        self._board.world.place(seed)
        self._board.record("place", seed=seed)

    @_at_board
    def put_back(self) -> None:
        """Put a vehicle that has collided back on its lane, at rest, to continue from there.

        In the plain room, which has no lane, it returns to its start. Its progress is kept.
        """
        with translate_errors(
            WorldError, to=lambda error: RobotError(f"The vehicle cannot be put back: {error}")
        ):
            self._board.world.put_back()
        self._board.record("put_back")

    @_at_board
    def lay_out(self, seed: int) -> None:
        """Replace the surroundings, and place the vehicle at a start in them.

        On a course in MuJoCo, this delays the board by some tenths of a second, and so does the
        first `put_back` on the course. Starting a twin with another seed has no such delay.
        """
        self._board.world.lay_out(seed)
        self._board.record("course", seed=seed)

    @_at_board
    def break_camera(self, fault: CameraFault) -> None:
        """Cause a fault of the camera; "" repairs it."""
        if self._board.camera is None:
            raise RobotError("This twin has no camera.")
        self._board.camera.break_down(fault)
        self._board.record("fault", detail=f"camera {fault or 'well'}")

    @_at_board
    def press_bumper(self, down: bool = True) -> None:
        """Press or release all bumpers."""
        for bumper in self._board.of_kind(SimulatedSwitch):
            bumper.held = down
        self._board.record("fault", detail=f"bumper {'down' if down else 'up'}")

    @_at_board
    def press_stop(self, down: bool = True) -> None:
        """Press or release the emergency stop button."""
        self._board.stop_held = down
        self._board.record("fault", detail=f"stop {'down' if down else 'up'}")

    @_at_board
    def set_distance(self, metres: float | None, *, dead: bool = False) -> None:
        """Override the readings of distance sensors, m; None for true ones, `dead` for no echo."""
        for sensor in self._board.of_kind(SimulatedHcsr04):
            sensor.override_m, sensor.dead = metres, dead
        self._board.record("fault", detail=f"distance {'dead' if dead else metres}")

    @_at_board
    def break_chip(self, bus: int, address: int, *, dead: bool = True) -> None:
        """Make an I2C chip stop replying, or, with `dead` false, reply again."""
        chips = self._board.dead_chips
        (chips.add if dead else chips.discard)((bus, address))
        self._board.record("fault", detail=f"chip {bus} {address} {'dead' if dead else 'well'}")

    @_at_board
    def break_servo(self, tendon: str, fault: ServoFault) -> None:
        """Cause a fault of a tendon's servo; "" repairs faults that can be repaired."""
        self._board.require_rig().break_servo(tendon, fault)
        self._board.record("fault", detail=f"servo {tendon} {fault or 'well'}")

    @_at_board
    def break_magnet(self, joint: str, state: Magnet = "gone") -> None:
        """Change the magnet of a joint's encoder; "" repairs it."""
        joints = {name: one for one in self._board.of_kind(SimulatedJoints) for name in one.magnets}
        require_known("joint with an encoder", joints, joint)
        joints[joint].set_magnet(joint, state)
        self._board.record("fault", detail=f"magnet {joint} {state or 'well'}")

    @_at_board
    def tensions(self) -> dict[str, float]:
        """Return the tension of each tendon on the servo bus, N."""
        return self._board.require_rig().tensions()

    @_at_board
    def levels(self) -> Levels:
        """Return the state of all outputs."""
        return self._board.levels

    @_at_board
    def where(self) -> Whereabouts:
        """Return the true state of the vehicle."""
        world = self._board.world
        seen = world.inputs()
        pose = (seen.pose.x, seen.pose.y, seen.pose.heading)
        motion = (seen.speed, seen.travelled_m, seen.bumped)
        return Whereabouts(*pose, *motion, world.distance_m(), world.truth(), self._board.clock())

    def close(self) -> None:
        """Disconnect from the board."""
        self._client.close()


def operator_functions(board: PinBoard) -> list[Callable[..., object]]:
    """Return the functions of an operator, bound to a board."""
    operator = Operator.__new__(Operator)
    operator._board = board  # pyright: ignore[reportPrivateUsage]
    bodies = (getattr(one, "__wrapped__", None) for one in vars(Operator).values())
    return [body.__get__(operator) for body in bodies if body is not None]
