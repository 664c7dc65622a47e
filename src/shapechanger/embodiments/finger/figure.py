"""The finger as it is drawn, beside the one that is simulated."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.embodiments.finger.anatomy import TENDONS
from shapechanger.embodiments.finger.drives import drive_of
from shapechanger.embodiments.finger.looks import THICKEST_M, THINNEST_M, courses_of
from shapechanger.embodiments.finger.model import TARGET, build_finger
from shapechanger.embodiments.finger.parameters import NOMINAL

__all__ = ["FingerFigure"]


class FingerFigure:
    """A finger with its anatomy that takes whatever posture it is shown in, and never moves itself.

    One figure shows every finger: they differ in what is not seen.

    Attributes:
        model: What is drawn.
        data: How.
    """

    def __init__(self) -> None:
        spec = build_finger(NOMINAL, drive_of("tension", NOMINAL), anatomy=True)
        self.model: mujoco.MjModel = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._mark = self.model.body(TARGET).mocapid[0]
        self._courses = [
            [self.model.tendon(course).id for course in courses_of(name)] for name in TENDONS
        ]

    def show(
        self, angles: NDArray[np.float64], pulled: NDArray[np.float64], target: NDArray[np.float64]
    ) -> None:
        """Take a posture.

        Args:
            angles: rad, (4,).
            pulled: Tension of each tendon over its largest, 0 to 1, (7,): how thick it is drawn.
            target: Where the fingertip should be, m, (3,).
        """
        widths = THINNEST_M + (THICKEST_M - THINNEST_M) * pulled.clip(0.0, 1.0)
        for courses, width in zip(self._courses, widths, strict=True):
            self.model.tendon_width[courses] = width
        self.data.qpos[:] = angles
        self.data.mocap_pos[self._mark] = target
        mujoco.mj_forward(self.model, self.data)

    def without_target(self) -> mujoco.MjModel:
        """A copy of the model in which no target is seen."""
        model = self.model.__copy__()
        model.geom_rgba[model.geom(TARGET).id, 3] = 0.0
        return model
