"""Parts that vehicles are built from: hulls, wheels, cameras, motors and servos."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import WorldError
from shapechanger.vehicles.bodies.visuals import OWN_VIEW, Paint, dress_wheel

# Collision bits. MuJoCo lets two geoms collide if the contype of one shares a bit with the
# conaffinity of the other. Walls have the type 1 and the affinity 2, the ground 4 and 8.
_HULL_TYPE, _HULL_MEETS = 2, 1  # Collides with walls and obstacles, not with the ground.
_WHEEL_TYPE, _WHEEL_MEETS = 10, 5  # Collides with all of them.

_HIDDEN_GROUP: Final = 3

HULL_FRICTION: Final = 0.2
"""Friction between a smooth plastic hull and a wall; an estimate, below that of rubber tyres."""

_WHEEL_FRICTION: Final = 0.3  # The larger one of the wheel and the ground counts.
_WHEEL_DAMPING: Final = 1e-4  # N·m·s/rad in the bearing; small, an estimate.

PI_CAMERA_FOVY_DEG: Final = 48.8
"""Raspberry Pi camera module 2: https://www.raspberrypi.com/documentation/accessories/camera.html"""


def add_look(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    material: str,
    *,
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Add a simple visual geom for the own camera: without mass and collisions.

    Its sizes are MuJoCo's, m; its orientation is x-y-z Euler angles.
    """
    quat = np.empty(4)
    mujoco.mju_euler2Quat(quat, np.radians(euler_deg), "xyz")
    body.add_geom(
        type=kind, pos=pos, size=_three(size), quat=quat, material=material, mass=0.0,
        contype=0, conaffinity=0, group=OWN_VIEW,
    )  # fmt: skip


def add_hull(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    mass: float,
) -> None:
    """Add a hidden collision geom with a mass, kg, and slightly soft contacts."""
    body.add_geom(
        name=name, type=kind, pos=pos, size=_three(size), mass=mass,
        friction=[HULL_FRICTION, 0.005, 0.0001], priority=1, condim=3,
        solref=[0.02, 1.0], solimp=[0.8, 0.95, 0.005, 0.5, 2.0], group=_HIDDEN_GROUP,
        contype=_HULL_TYPE, conaffinity=_HULL_MEETS,
    )  # fmt: skip


def add_wheel(
    body: mujoco.MjsBody,
    name: str,
    pos: tuple[float, float, float],
    radius: float,
    width: float,
    mass: float,
    paint: Paint,
    *,
    armature: float = 0.0,
    friction: float | None = None,
    tyre: str = "tyre",
) -> mujoco.MjsBody:
    """Add a wheel; rolling forward is positive.

    It collides as a flat ellipsoid, which touches the ground in one point.

    Args:
        body: Body to extend.
        name: Name of its body, joint and geom.
        pos: Position of its middle, m.
        radius: Radius, m.
        width: Width, m.
        mass: Mass, kg.
        paint: Source of its materials.
        armature: Share of the motor's rotor inertia, kg·m2.
        friction: Friction on any ground; None for that of the ground.
        tyre: Colour of the tyre, or "track" for a road wheel within a track.
    """
    wheel = body.add_body(name=name, pos=pos)
    wheel.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0],
        armature=armature, damping=_WHEEL_DAMPING,
    )  # fmt: skip
    wheel.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[radius, width / 2, radius],
        mass=mass, friction=[friction or _WHEEL_FRICTION, 0.005, 0.0001],
        priority=0 if friction is None else 1, condim=3, group=_HIDDEN_GROUP,
        contype=_WHEEL_TYPE, conaffinity=_WHEEL_MEETS,
    )  # fmt: skip
    aside = (90.0, 0.0, 0.0)
    size, black = (radius, width / 2), paint(tyre)
    add_look(wheel, mujoco.mjtGeom.mjGEOM_CYLINDER, (0.0, 0.0, 0.0), size, black, euler_deg=aside)
    dress_wheel(wheel, radius, paint)
    return wheel


@dataclass(frozen=True, slots=True)
class CameraMount:
    """Pose and field of view of a vehicle's camera.

    Attributes:
        x: Position ahead of the vehicle's origin, m.
        y: Position to the left of it, m.
        z: Height above the ground, m.
        pitch_rad: Angle of the optical axis below the horizon.
        fovy_deg: Vertical field of view.
    """

    x: float
    y: float
    z: float
    pitch_rad: float
    fovy_deg: float = PI_CAMERA_FOVY_DEG

    def aimed(self, pitch_deg: float | None, fovy_deg: float | None) -> CameraMount:
        """Return the mount with the pitch and the field of view, degrees, that a profile states."""
        return replace(
            self,
            pitch_rad=self.pitch_rad if pitch_deg is None else math.radians(pitch_deg),
            fovy_deg=self.fovy_deg if fovy_deg is None else fovy_deg,
        )


def add_camera(body: mujoco.MjsBody, mount: CameraMount) -> None:
    """Add the camera "vehicle/camera", which looks ahead."""
    aim_camera(body.add_camera(name="vehicle/camera"), mount)


def aim_camera(camera: mujoco.MjsCamera, mount: CameraMount) -> None:
    """Change the pose and the field of view of a camera."""
    s, c = math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)
    # The columns are its axes: x to the right, y up, and z backwards, against its view.
    axes = np.array([[0.0, s, -c], [-1.0, 0.0, 0.0], [0.0, c, s]])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    camera.pos, camera.quat, camera.fovy = [mount.x, mount.y, mount.z], quat, mount.fovy_deg


# Largest errors of a screwed, printed mount: estimates.
_HEIGHT_M: Final = 0.015
_SIDE_M: Final = 0.01
_ANGLE_RAD: Final = math.radians(3.0)

_LOWEST_M: Final = 0.01  # Above the floor.
_FARTHEST_M: Final = 1.0  # Still on the vehicle.


@dataclass(frozen=True, slots=True)
class CameraJitter:
    """Error of a camera's pose.

    Attributes:
        up_m: Offset upwards, m.
        left_m: Offset to the left, m.
        roll_rad: Rotation about the line of sight; positive to the right.
        pitch_rad: Positive down.
        yaw_rad: Positive to the left.
    """

    up_m: float = 0.0
    left_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0

    @staticmethod
    def random(rng: np.random.Generator) -> CameraJitter:
        """Draw uniform errors of up to 1.5 cm in height, 1 cm to the side and 3 degrees."""
        up, left = rng.uniform(-1.0, 1.0, 2) * (_HEIGHT_M, _SIDE_M)
        roll, pitch, yaw = rng.uniform(-_ANGLE_RAD, _ANGLE_RAD, 3)
        return CameraJitter(float(up), float(left), float(roll), float(pitch), float(yaw))


def move_camera(model: mujoco.MjModel, camera: str, jitter: CameraJitter) -> None:
    """Add an error to the pose of a camera; a refused error changes nothing."""
    place = model.camera(camera)
    position = place.pos + np.array((0.0, jitter.left_m, jitter.up_m))
    turns = jitter.roll_rad, jitter.pitch_rad, jitter.yaw_rad
    if not np.isfinite([*position, *turns]).all():
        raise WorldError(f"The error of a camera's pose must be finite, got {jitter}.")
    if position[2] < _LOWEST_M or np.abs(position).max() > _FARTHEST_M:
        where = ", ".join(f"{x:.3f}" for x in position)
        raise WorldError(f"The camera would be off its vehicle or in the floor, at ({where}) m.")
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


def _three(size: ArrayLike) -> NDArray[np.float64]:
    """Sizes padded with zeros to three numbers."""
    given = np.asarray(size, dtype=np.float64)
    return np.concatenate([given, np.zeros(3 - len(given))])


BATTERY_V: Final = 7.2
"""Voltage of six NiMH cells, the usual battery of cars of this size."""

_KGF_CM: Final = 0.0980665  # N·m
_RPM: Final = 2.0 * math.pi / 60.0  # rad/s


@dataclass(frozen=True, slots=True)
class DcMotor:
    """A brushed DC motor with a gear, seen from the output shaft.

    voltage = resistance * current + volts_per_speed * speed. Losses of the gear are part of
    `torque_per_current`; dry friction is part of `free_a` and makes the dead band.

    Attributes:
        resistance: Resistance of the winding, Ohm.
        volts_per_speed: Back EMF, V·s/rad.
        torque_per_current: Stall torque per current, N·m/A.
        free_a: Current without load, A.
        rotor_inertia: Inertia at the output shaft, kg·m2.
    """

    resistance: float
    volts_per_speed: float
    torque_per_current: float
    free_a: float
    rotor_inertia: float

    @property
    def friction(self) -> float:
        """Dry friction torque at the shaft, N·m."""
        return self.torque_per_current * self.free_a

    @property
    def damping(self) -> float:
        """Damping of the shorted motor, N·m·s/rad."""
        return self.torque_per_current * self.volts_per_speed / self.resistance

    def geared(self, ratio: float, efficiency: float = 1.0) -> DcMotor:
        """The motor with one more gear stage: turns of this shaft per turn of the next."""
        return replace(
            self,
            volts_per_speed=self.volts_per_speed * ratio,
            torque_per_current=self.torque_per_current * ratio * efficiency,
            rotor_inertia=self.rotor_inertia * ratio**2,
        )

    def amperes(self, volts: float, speed: float) -> float:
        """Current from the battery, A, at a voltage and a speed of the shaft, rad/s.

        It is 0 while the motor brakes through its bridge.
        """
        current = (volts - self.volts_per_speed * speed) / self.resistance
        return max(0.0, current if volts > 0.0 else -current) if volts else 0.0

    def add(self, spec: mujoco.MjSpec, name: str) -> mujoco.MjsTendon:
        """Add the motor as an actuator controlled by a voltage, and its shaft as a fixed tendon.

        MuJoCo's affine actuator implements the motor's equation:
        https://mujoco.readthedocs.io/en/stable/XMLreference.html#actuator-general
        """
        shaft = spec.add_tendon(
            name=name,
            frictionloss=self.friction,
            # Stiffer than MuJoCo's default, so that friction holds the shaft.
            solref_friction=[0.01, 1.0],
            solimp_friction=[0.99, 0.999, 0.001, 0.5, 2.0],
        )
        gain = self.torque_per_current / self.resistance
        _add_actuator(spec, mujoco.mjtTrn.mjTRN_TENDON, name, name, gain, 0.0, -self.damping)
        return shaft


@dataclass(frozen=True, slots=True)
class ServoMotor:
    """A hobby servo, which turns to an angle at a limited speed and holds it.

    Attributes:
        stall_torque: Largest torque, N·m.
        free_rate: Speed without load, rad/s.
        error_at_stall: Smallest error of its angle at which it gives its largest torque, rad.
    """

    stall_torque: float
    free_rate: float
    error_at_stall: float = math.radians(4.0)  # An estimate; cheap ones hold to a few degrees.

    @property
    def damping(self) -> float:
        """Damping of its joint, N·m·s/rad: at full torque it turns at the free rate."""
        return self.stall_torque / self.free_rate

    def add(self, spec: mujoco.MjSpec, name: str, joint: str, share: float = 1.0) -> None:
        """Add the servo as an actuator controlled by an angle, rad, with a share of its torque."""
        torque = share * self.stall_torque
        stiffness = torque / self.error_at_stall
        servo = _add_actuator(
            spec, mujoco.mjtTrn.mjTRN_JOINT, name, joint, stiffness, -stiffness, 0.0
        )
        servo.forcelimited, servo.forcerange = True, [-torque, torque]


def _add_actuator(
    spec: mujoco.MjSpec,
    kind: mujoco.mjtTrn,
    name: str,
    target: str,
    gain: float,
    stiffness: float,
    damping: float,
) -> mujoco.MjsActuator:
    """Add an actuator whose force is linear in its control, its length and its velocity."""
    return spec.add_actuator(
        name=name, trntype=kind, target=target, gaintype=mujoco.mjtGain.mjGAIN_FIXED,
        gainprm=[gain, *[0.0] * 9], biastype=mujoco.mjtBias.mjBIAS_AFFINE,
        biasprm=[0.0, stiffness, damping, *[0.0] * 7],
    )  # fmt: skip


# Pololu item 4801, a motor of 25 mm with a gear of 4.4:1: https://www.pololu.com/product/4801. At
# 6 V it runs freely at 2200 rpm with 0.5 A, and stalls at 6 A with 1.2 kgf·cm.
HOBBY_MOTOR: Final = DcMotor(
    resistance=6.0 / 6.0,
    volts_per_speed=(6.0 - 0.5 * 1.0) / (2200.0 * _RPM),
    torque_per_current=1.2 * _KGF_CM / 6.0,
    free_a=0.5,
    # An estimate: a rotor of 20 g and 8 mm radius, times the gear squared.
    rotor_inertia=0.5 * 0.020 * 0.008**2 * 4.4**2,
)
"""Motor of all vehicles here, each with a further gear stage."""

HOBBY_SERVO: Final = ServoMotor(
    # Hitec HS-311 at 4.8 V: 3.0 kgf·cm, 60 degrees in 0.19 s, by its data sheet.
    stall_torque=3.0 * _KGF_CM,
    free_rate=math.radians(60.0) / 0.19,
)
