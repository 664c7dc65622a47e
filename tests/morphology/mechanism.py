"""A mechanism in which elements name each other in every way, generated from a few numbers."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from tests.models import xml

_TEXT = xml("mechanism")


class Mechanism(NamedTuple):
    """Parameters of the mechanism."""

    crank: tuple[float, float]  # End of the crank in the plane of motion, x and z, m.
    coupler: tuple[float, float]  # End of the coupler relative to the end of the crank, x and z, m.
    rocker: tuple[float, float]  # End of the rocker relative to its hinge, x and z, m.
    pin: float  # Place of the pin on the coupler as a share of its length.
    tool: float  # Place of the tool on the coupler as a share of its length.
    turn: float  # Turn of the crank's frame, rad.
    slope: float  # Slope of the coupling of both fingers.
    curve: float  # Quadratic coefficient of this coupling.
    form: str  # How the pin is written: "anchor", "reversed", "sites" or "weld".
    floats: bool  # Whether the base is free.
    in_degrees: bool  # Whether angles are written in degrees.
    boundmass: float  # The compiler's least mass, kg.

    def spec(self) -> mujoco.MjSpec:
        cos, sin = np.cos(self.turn), np.sin(self.turn)

        def local(x: float, z: float) -> np.ndarray:
            """Return a vector of the world in the frame of the crank and the coupler."""
            return np.array([cos * x - sin * z, 0.0, sin * x + cos * z])

        crank, coupler = local(*self.crank), local(*self.coupler)
        rocker = np.array([self.rocker[0], 0.0, self.rocker[1]])
        pin = self.pin * coupler
        closed = np.array([self.crank[0], 0.0, self.crank[1]])
        closed += self.pin * np.array([self.coupler[0], 0.0, self.coupler[1]])
        across = np.cross(coupler, [0.0, 1.0, 0.0])
        along = np.empty(4)
        # A box with its first axis along the coupler.
        mujoco.mju_mat2Quat(
            along,
            np.column_stack(
                [coupler / np.linalg.norm(coupler), [0, 1, 0], across / np.linalg.norm(across)]
            ).ravel(),
        )
        pins = {
            "anchor": f'<connect name="pin" body1="coupler" body2="rocker" anchor="{_text(pin)}"/>',
            "reversed": '<connect name="pin" body1="rocker" body2="coupler" '
            f'anchor="{_text(rocker)}"/>',
            "sites": '<connect name="pin" site1="pin on coupler" site2="pin on rocker"/>',
            "weld": f'<weld name="pin" body1="rocker" body2="coupler" anchor="{_text(pin)}"/>',
        }

        def angles(*values: float) -> str:
            return _text(np.degrees(values) if self.in_degrees else np.array(values))

        return mujoco.MjSpec.from_string(
            _TEXT.format(
                angle="degree" if self.in_degrees else "radian",
                boundmass=self.boundmass,
                root='<freejoint name="root"/>' if self.floats else "",
                free="0 0 .5 1 0 0 0 " if self.floats else "",
                turn=angles(self.turn),
                wide=angles(-2.5, 2.5),
                narrow=angles(-0.5, 0.5),
                crank=_text(crank),
                coupler=_text(coupler),
                rocker=_text(rocker),
                rocker_at=_text(closed - rocker),
                pin=_text(pin),
                tool=_text(self.tool * coupler),
                drum=_text(0.5 * crank),
                side=_text(0.5 * crank + np.array([0.0, 0.05, 0.0])),
                housing=_text(0.15 * coupler),
                along=_text(along),
                pin_text=pins[self.form],
                slope=self.slope,
                curve=self.curve,
            )
        )


def _text(values: np.ndarray) -> str:
    return " ".join(map(repr, np.asarray(values, float).tolist()))
