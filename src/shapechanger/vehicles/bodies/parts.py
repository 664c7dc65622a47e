"""Parts of vehicles: cameras, motors and servos."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import WorldError

PI_CAMERA_FOVY_DEG: Final = 48.8
"""Vertical field of view of the Raspberry Pi camera module 2, degrees:
https://www.raspberrypi.com/documentation/accessories/camera.html."""


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Pose and field of view of a vehicle's camera."""

    x: float  # Position ahead of the vehicle's origin, m.
    z: float  # Height above the ground, m.
    y: float = 0.0  # Position to the left of the origin, m.
    pitch_rad: float = 0.0  # Angle of the optical axis below the horizon.
    fovy_deg: float = PI_CAMERA_FOVY_DEG  # Vertical field of view.

    def aimed(self, pitch_deg: float | None, fovy_deg: float | None) -> CameraMount:
        """Return the mount with the pitch and the field of view, degrees, that a profile states."""
        return replace(
            self,
            pitch_rad=self.pitch_rad if pitch_deg is None else math.radians(pitch_deg),
            fovy_deg=self.fovy_deg if fovy_deg is None else fovy_deg,
        )


def aim_camera(camera: mujoco.MjsCamera, mount: CameraMount) -> None:
    """Change the pose and the field of view of a camera."""
    s, c = math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)
    # The columns are the camera's axes: x to the right, y up, and z opposite to its view.
    axes = np.array([[0.0, s, -c], [-1.0, 0.0, 0.0], [0.0, c, s]])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    camera.pos, camera.quat, camera.fovy = [mount.x, mount.y, mount.z], quat, mount.fovy_deg


# Estimates of the largest errors of a printed mount that is fixed with screws.
_HEIGHT_M, _SIDE_M, _ANGLE_RAD = 0.015, 0.01, math.radians(3.0)
# Least height above the floor and largest coordinate in the vehicle's frame, m.
_LOWEST_M, _FARTHEST_M = 0.01, 1.0


@dataclass(frozen=True, slots=True)
class CameraJitter:
    """Error of a camera's pose."""

    up_m: float = 0.0
    left_m: float = 0.0
    roll_rad: float = 0.0  # Rotation about the line of sight; positive to the right.
    pitch_rad: float = 0.0  # Positive down.
    yaw_rad: float = 0.0  # Positive to the left.

    @staticmethod
    def random(rng: np.random.Generator) -> CameraJitter:
        """Draw uniform errors of up to 1.5 cm in height, 1 cm to the side and 3 degrees."""
        up, left = rng.uniform(-1.0, 1.0, 2) * (_HEIGHT_M, _SIDE_M)
        roll, pitch, yaw = rng.uniform(-_ANGLE_RAD, _ANGLE_RAD, 3)
        return CameraJitter(float(up), float(left), float(roll), float(pitch), float(yaw))


def move_camera(model: mujoco.MjModel, camera: str, jitter: CameraJitter) -> None:
    """Add an error to the pose of a camera, or raise a `WorldError` before any change."""
    place = model.camera(camera)
    position = place.pos + np.array((0.0, jitter.left_m, jitter.up_m))
    turns = jitter.roll_rad, jitter.pitch_rad, jitter.yaw_rad
    finite = np.isfinite([*position, *turns]).all()
    if not finite or position[2] < _LOWEST_M or np.abs(position).max() > _FARTHEST_M:
        raise WorldError(f"The camera must be above the floor and on its vehicle, got {jitter}.")
    place.pos[:] = position
    # A MuJoCo camera looks along -z of its frame, with x to the right and y up.
    turned = np.empty(4)
    for axis, angle in (
        ((0.0, 1.0, 0.0), jitter.yaw_rad),
        ((1.0, 0.0, 0.0), -jitter.pitch_rad),
        ((0.0, 0.0, 1.0), -jitter.roll_rad),
    ):
        turn = np.empty(4)
        mujoco.mju_axisAngle2Quat(turn, np.array(axis), angle)
        mujoco.mju_mulQuat(turned, place.quat, turn)
        place.quat[:] = turned


BATTERY_V: Final = 7.2
"""Voltage of six NiMH cells, the usual battery of cars of this size."""

_KGF_CM: Final = 0.0980665  # N·m
_RPM: Final = 2.0 * math.pi / 60.0  # rad/s


@dataclass(frozen=True, slots=True)
class DcMotor:
    """A brushed DC motor with a gear; speeds and torques are at the output shaft.

    voltage = resistance * current + volts_per_speed * speed.
    """

    resistance: float  # Resistance of the winding, Ohm.
    volts_per_speed: float  # Back EMF, V·s/rad.
    torque_per_current: float  # Stall torque per current, with losses of the gear, N·m/A.
    free_a: float  # Current without load, A; it includes dry friction, which causes the dead band.
    rotor_inertia: float  # Inertia at the output shaft, kg·m2.

    @property
    def friction(self) -> float:
        """Dry friction torque at the shaft, N·m."""
        return self.torque_per_current * self.free_a

    @property
    def damping(self) -> float:
        """Damping of the shorted motor, N·m·s/rad."""
        return self.torque_per_current * self.volts_per_speed / self.resistance

    def geared(self, ratio: float, efficiency: float = 1.0) -> DcMotor:
        """The motor with one more gear stage, whose shaft turns once for `ratio` turns."""
        return replace(
            self,
            volts_per_speed=self.volts_per_speed * ratio,
            torque_per_current=self.torque_per_current * ratio * efficiency,
            rotor_inertia=self.rotor_inertia * ratio**2,
        )

    def amperes(self, volts: float, speed: float) -> float:
        """Current from the battery, A, at a voltage and a shaft speed, rad/s; 0 while braking."""
        current = (volts - self.volts_per_speed * speed) / self.resistance
        return max(0.0, current if volts > 0.0 else -current) if volts else 0.0

    def add(self, spec: mujoco.MjSpec) -> None:
        """Set up the actuator of each tendon as a motor of this kind, controlled by its voltage.

        MuJoCo's affine actuator implements the motor's equation:
        https://mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-general
        """
        driven = [joint for joint in spec.joints if joint.classname.name == "driven"]
        for joint in driven:
            joint.armature += self.rotor_inertia / (len(driven) // len(spec.tendons))
        for shaft in spec.tendons:
            shaft.frictionloss = self.friction
            # Stiffer than MuJoCo's default, so that friction holds the shaft.
            shaft.solref_friction = [0.01, 1.0]
            shaft.solimp_friction = [0.99, 0.999, 0.001, 0.5, 2.0]
            motor = spec.actuator(shaft.name)
            motor.gainprm[0] = self.torque_per_current / self.resistance
            motor.biasprm[2] = -self.damping


# Pololu item 4801, a motor of 25 mm with a gear of 4.4:1: https://www.pololu.com/product/4801. At
# 6 V it runs freely at 2200 rpm with 0.5 A, and stalls at 6 A with 1.2 kgf·cm.
HOBBY_MOTOR: Final = DcMotor(
    resistance=6.0 / 6.0,
    volts_per_speed=(6.0 - 0.5 * 1.0) / (2200.0 * _RPM),
    torque_per_current=1.2 * _KGF_CM / 6.0,
    free_a=0.5,
    # An estimate: the inertia of a rotor of 20 g and 8 mm radius, times the squared gear ratio.
    rotor_inertia=0.5 * 0.020 * 0.008**2 * 4.4**2,
)
"""Motor of all vehicles, each with a further gear stage."""

# Hitec HS-311 at 4.8 V, from its data sheet: 3.0 kgf·cm, 60 degrees in 0.19 s. The smallest angle
# error at which it gives its full torque is an estimate; cheap servos hold to a few degrees.
_STALL_TORQUE, _FREE_RATE = 3.0 * _KGF_CM, math.radians(60.0) / 0.19  # N·m and rad/s.
_ERROR_AT_STALL: Final = math.radians(4.0)


def add_servo(spec: mujoco.MjSpec) -> None:
    """Set up the actuators of the steering joints as one hobby servo, controlled by angles, rad.

    The servo turns at a limited speed: without load, its full torque gives its free rate.
    """
    joints = [joint for joint in spec.joints if joint.classname.name == "steering"]
    for joint in joints:
        torque = _STALL_TORQUE / len(joints)
        joint.damping[0] = _STALL_TORQUE / _FREE_RATE / len(joints)
        servo = spec.actuator(joint.name)
        servo.gainprm[0] = torque / _ERROR_AT_STALL
        servo.biasprm[1] = -servo.gainprm[0]
        servo.forcelimited, servo.forcerange = True, [-torque, torque]
