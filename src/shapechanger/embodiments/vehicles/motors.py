"""Motors and servos: what their data sheets say, and the actuators that follow from it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import mujoco

__all__ = ["BATTERY_V", "HOBBY_MOTOR", "HOBBY_SERVO", "Motor", "Servo"]

BATTERY_V: Final = 7.2
"""Six cells of NiMH, the usual battery of cars of this size."""

_KGF_CM: Final = 0.0980665  # N·m
_RPM: Final = 2.0 * math.pi / 60.0  # rad/s


@dataclass(frozen=True, slots=True)
class Motor:
    """A brushed DC motor behind its gear, seen from the gear's shaft.

    Voltage = resistance times current + `volts_per_speed` times speed. What the gear loses is in
    `torque_per_current`, and its dry friction in `free_a`: that makes the dead band.

    Attributes:
        resistance: Of the winding, Ohm.
        volts_per_speed: Back EMF, V·s/rad.
        torque_per_current: At a standstill, N·m/A.
        free_a: Current without load, A.
        rotor_inertia: As felt at the shaft, kg·m2.
    """

    resistance: float
    volts_per_speed: float
    torque_per_current: float
    free_a: float
    rotor_inertia: float

    @property
    def friction(self) -> float:
        """Torque that holds the shaft until the motor overcomes it, N·m."""
        return self.torque_per_current * self.free_a

    @property
    def damping(self) -> float:
        """How the shorted motor brakes, N·m·s/rad."""
        return self.torque_per_current * self.volts_per_speed / self.resistance

    def geared(self, ratio: float, efficiency: float = 1.0) -> Motor:
        """With one more stage: `ratio` turns of this shaft for one of the next."""
        return replace(
            self,
            volts_per_speed=self.volts_per_speed * ratio,
            torque_per_current=self.torque_per_current * ratio * efficiency,
            rotor_inertia=self.rotor_inertia * ratio**2,
        )

    def amperes(self, volts: float, speed: float) -> float:
        """Current that the battery gives, A, at a voltage and a speed of the shaft in rad/s.

        The bridge lets a motor that is faster than its voltage brake on itself: that is 0.
        """
        current = (volts - self.volts_per_speed * speed) / self.resistance
        return max(0.0, current if volts > 0.0 else -current) if volts else 0.0

    def add(self, spec: mujoco.MjSpec, name: str) -> mujoco.MjsTendon:
        """Add the motor, whose control is a voltage, and its shaft: a tendon for joints to wrap.

        MuJoCo's affine actuator is the motor's equation:
        https://mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-general
        """
        shaft = spec.add_tendon(
            name=name,
            frictionloss=self.friction,
            # MuJoCo's friction is a little soft; harder than its default, so that it holds.
            solref_friction=[0.01, 1.0],
            solimp_friction=[0.99, 0.999, 0.001, 0.5, 2.0],
        )
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            target=name,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=[self.torque_per_current / self.resistance, *[0.0] * 9],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0.0, 0.0, -self.damping, *[0.0] * 7],
        )
        return shaft


def _from_data_sheet(
    *,
    volts: float,
    free_rpm: float,
    free_a: float,
    stall_a: float,
    stall_kgf_cm: float,
    rotor_inertia: float,
) -> Motor:
    resistance = volts / stall_a
    return Motor(
        resistance=resistance,
        volts_per_speed=(volts - free_a * resistance) / (free_rpm * _RPM),
        torque_per_current=stall_kgf_cm * _KGF_CM / stall_a,
        free_a=free_a,
        rotor_inertia=rotor_inertia,
    )


@dataclass(frozen=True, slots=True)
class Servo:
    """A hobby servo: it turns to an angle no faster than its motor can, and holds it.

    Attributes:
        stall_torque: N·m.
        free_rate: Without load, rad/s.
        error_at_stall: How far from its angle it has to be to give all its torque, rad.
    """

    stall_torque: float
    free_rate: float
    error_at_stall: float = math.radians(4.0)  # An estimate; cheap ones hold to a few degrees.

    @property
    def damping(self) -> float:
        """Of the joint, N·m·s/rad: at full torque it turns at the free rate, as a motor does."""
        return self.stall_torque / self.free_rate

    def add(self, spec: mujoco.MjSpec, name: str, joint: str, share: float = 1.0) -> None:
        """Add the actuator, whose control is an angle in rad, with a share of the torque."""
        torque = share * self.stall_torque
        stiffness = torque / self.error_at_stall
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            target=joint,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED,
            gainprm=[stiffness, *[0.0] * 9],
            biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            biasprm=[0.0, -stiffness, *[0.0] * 8],
            forcelimited=True,
            forcerange=[-torque, torque],
        )


HOBBY_MOTOR: Final = _from_data_sheet(
    # Pololu item 4801, a motor of 25 mm with a gear of 4.4:1: https://www.pololu.com/product/4801
    volts=6.0,
    free_rpm=2200.0,
    free_a=0.5,
    stall_a=6.0,
    stall_kgf_cm=1.2,
    # An estimate: a rotor of 20 g and 8 mm radius, times the gear squared.
    rotor_inertia=0.5 * 0.020 * 0.008**2 * 4.4**2,
)
"""The motor of every vehicle here, each behind one more stage of its own."""

HOBBY_SERVO: Final = Servo(
    # Hitec HS-311 at 4.8 V: 3.0 kgf·cm, 60 degrees in 0.19 s, by its data sheet.
    stall_torque=3.0 * _KGF_CM,
    free_rate=math.radians(60.0) / 0.19,
)
