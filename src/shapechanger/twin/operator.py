"""An operator of the twin: puts the vehicle back, breaks and presses things, lets time go by."""

from __future__ import annotations

from typing import NamedTuple

from shapechanger.twin.camera import CameraFault
from shapechanger.twin.chips.as5600 import Magnet
from shapechanger.twin.levels import Channel, Levels, Pulse
from shapechanger.twin.link import Link
from shapechanger.twin.rig import ServoFault

__all__ = ["Operator", "Whereabouts"]


class Whereabouts(NamedTuple):
    """Where the vehicle really is.

    Attributes:
        x: In metres.
        y: In metres.
        heading: Radians from the x axis, counter-clockwise seen from above.
        speed: m/s along the heading.
        travelled_m: Metres that the wheels rolled, backward counts down.
        bumped: Whether something presses its bumper.
        distance_m: Free distance ahead of its nose.
        truth: What nobody on board knows, such as how far it came along the course, by name.
        t: When, in nanoseconds.
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


class Operator:
    """A person beside the robot. What it asks is answered after all that was said before.

    Args:
        path: The socket at which the board listens.
    """

    def __init__(self, path: str) -> None:
        self._link = Link(path, "operator")

    def __enter__(self) -> Operator:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def place(self, seed: int) -> None:
        """Put the vehicle at the start that follows from this seed."""
        self._link.ask(op="place", seed=seed)

    def put_back(self) -> None:
        """Put a vehicle that ran into something back on the lane, at rest, from where it goes on.

        In the plain room, which has no lane, it is put at its start. Its truth counts on.
        """
        self._link.ask(op="put_back")

    def lay_out(self, seed: int) -> None:
        """Put other surroundings around the vehicle, and the vehicle at a start in them.

        On a course in MuJoCo this takes some tenths of a second, for which the board stands still,
        and so does the first `put_back` on it. On a busy machine a guard in real time may be taken
        for dead meanwhile; a twin that is started with another seed has no such wait.
        """
        self._link.ask(op="course", seed=seed)

    def advance(self, seconds: float) -> int:
        """Let time go by on the twin's clock, and say what time it is then, in nanoseconds.

        Raises:
            RobotError: If the board runs in real time.
        """
        return self._link.ask(op="sleep", ns=round(seconds * 1e9))["t"]

    def break_camera(self, how: CameraFault) -> None:
        """Let the camera fail; "" for a camera that works."""
        self._link.ask(op="camera", how=how)

    def press_bumper(self, down: bool = True) -> None:
        """Press all bumpers, or let them go."""
        self._link.ask(op="press", what="bumper", down=down)

    def press_stop(self, down: bool = True) -> None:
        """Press the emergency stop button, or let it go."""
        self._link.ask(op="press", what="stop", down=down)

    def set_battery(self, volts: float | None) -> None:
        """Let the battery have this voltage without load; None for a full one."""
        self._link.ask(op="battery", volts=volts)

    def set_distance(self, metres: float | None, *, dead: bool = False) -> None:
        """Let distance sensors see this; None for the truth, and `dead` for no echo at all."""
        self._link.ask(op="distance", metres=metres, dead=dead)

    def break_chip(self, bus: int, address: int, *, dead: bool = True) -> None:
        """Let a chip stop answering, or answer again."""
        self._link.ask(op="chip", bus=bus, address=address, dead=dead)

    def break_servo(self, tendon: str, how: ServoFault) -> None:
        """Let something happen to the servo of a tendon; "" takes back what can be taken back."""
        self._link.ask(op="servo_fault", tendon=tendon, how=how)

    def break_magnet(self, joint: str, how: Magnet = "gone") -> None:
        """Let something happen to the magnet of a joint's encoder; "" for one that is well."""
        self._link.ask(op="magnet", joint=joint, how=how)

    def tensions(self) -> dict[str, float]:
        """What each tendon on the servo bus is pulled with now, N, by name."""
        return self._link.ask(op="tensions")["tensions"]

    def levels(self) -> Levels:
        """What all outputs do now."""
        answer = self._link.ask(op="levels")
        return Levels(
            duties=dict(answer["duties"]),
            pulses={pin: Pulse(us, hz) for pin, us, hz in answer["pulses"]},
            channels={Channel(b, a, n): Pulse(us, hz) for b, a, n, us, hz in answer["channels"]},
            edges_ns=dict(answer["edges_ns"]),
        )

    def where(self) -> Whereabouts:
        """Where the vehicle is."""
        answer = self._link.ask(op="where")
        return Whereabouts(**{name: answer[name] for name in Whereabouts._fields})

    def close(self) -> None:
        """Leave."""
        self._link.close()
