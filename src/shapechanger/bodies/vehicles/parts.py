"""What the bodies are put together from: hulls, wheels, paint and cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.bodies.vehicles.model import CameraMount

__all__ = [
    "BATTERY_V",
    "HOBBY_MOTOR",
    "HOBBY_SERVO",
    "PI_CAMERA_FOVY_DEG",
    "DcMotor",
    "MotorDrive",
    "Paint",
    "ServoMotor",
    "add_camera",
    "add_hull",
    "add_look",
    "add_wheel",
    "joints_below_chassis",
    "settle",
]

# What touches what: MuJoCo lets two geoms collide if the type of one meets the affinity of the
# other. The world is 1 and meets 2, the ground is 4 and meets 8.
_HULL_TYPE, _HULL_MEETS = 2, 1  # Walls and things, not the ground.
_WHEEL_TYPE, _WHEEL_MEETS = 10, 5  # Those and the ground.

_HIDDEN_GROUP: Final = 3

HULL_FRICTION: Final = 0.2
"""Between a smooth plastic body and a wall, an estimate; rubber at the wheels grips more."""

_WHEEL_FRICTION: Final = 0.3  # Of the wheel alone: the ground's counts where that is larger.

PI_CAMERA_FOVY_DEG: Final = 48.8
"""Raspberry Pi camera module 2: https://www.raspberrypi.com/documentation/accessories/camera.html"""


class Paint:
    """Colours that shine by themselves a little, for worlds whose light is painted on."""

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self._spec = spec
        self._made: set[str] = set()

    def __call__(self, name: str, rgb: tuple[float, float, float]) -> str:
        """The name of the material of this colour."""
        material = f"vehicle/{name}"
        if material not in self._made:
            self._spec.add_material(
                name=material, rgba=[*rgb, 1.0], emission=0.6, specular=0.2, shininess=0.3
            )
            self._made.add(material)
        return material


def add_look(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    material: str,
    *,
    euler_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> None:
    """Add a shape that is seen, but neither weighs nor touches anything."""
    quat = np.empty(4)
    mujoco.mju_euler2Quat(quat, np.radians(euler_deg), "xyz")
    body.add_geom(
        type=kind, pos=pos, size=_three(size), quat=quat, material=material, mass=0.0,
        contype=0, conaffinity=0, group=0,
    )  # fmt: skip


def add_hull(
    body: mujoco.MjsBody,
    name: str,
    kind: mujoco.mjtGeom,
    pos: ArrayLike,
    size: ArrayLike,
    mass: float,
    *,
    quat: ArrayLike = (1.0, 0.0, 0.0, 0.0),
) -> None:
    """Add a shape that weighs and that bumps into things, a little softly, and is not seen."""
    body.add_geom(
        name=name, type=kind, pos=pos, size=_three(size), quat=quat, mass=mass,
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
    damping: float = 1e-4,
    friction: float | None = None,
    tyre: tuple[float, float, float] = (0.05, 0.05, 0.05),
) -> mujoco.MjsBody:
    """Add a wheel that rolls: forward is positive.

    It touches the ground as a flat ellipsoid does, in one point.

    Args:
        body: What it is fixed to.
        name: Of its body, joint and geom.
        pos: Of its middle, m.
        radius: m.
        width: m.
        mass: kg.
        paint: For its colours.
        armature: Share of the motor's rotor, kg·m2.
        damping: Of its bearing, N·m·s/rad; small, an estimate.
        friction: Its own, whatever the ground; or else the ground's.
        tyre: Colour, red, green and blue.
    """
    wheel = body.add_body(name=name, pos=pos)
    wheel.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0],
        armature=armature, damping=damping,
    )  # fmt: skip
    wheel.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[radius, width / 2, radius],
        mass=mass, friction=[friction or _WHEEL_FRICTION, 0.005, 0.0001],
        priority=0 if friction is None else 1, condim=3, group=_HIDDEN_GROUP,
        contype=_WHEEL_TYPE, conaffinity=_WHEEL_MEETS,
    )  # fmt: skip
    cylinder = mujoco.mjtGeom.mjGEOM_CYLINDER
    black = paint("tyre" if tyre == (0.05, 0.05, 0.05) else "track", tyre)
    grey = paint("rim", (0.55, 0.55, 0.58))
    aside = (90.0, 0.0, 0.0)
    add_look(wheel, cylinder, (0.0, 0.0, 0.0), (radius, width / 2), black, euler_deg=aside)
    add_look(wheel, cylinder, (0.0, 0.0, 0.0), (0.55 * radius, 0.52 * width), grey, euler_deg=aside)
    box = mujoco.mjtGeom.mjGEOM_BOX  # A spoke, so that one sees it turn.
    add_look(wheel, box, (0.0, 0.0, 0.0), (0.5 * radius, 0.54 * width, 0.12 * radius), black)
    return wheel


def add_camera(body: mujoco.MjsBody, mount: CameraMount) -> None:
    """Add the camera, which looks ahead."""
    s, c = math.sin(mount.pitch_rad), math.cos(mount.pitch_rad)
    # Columns are its axes: x to the right, y up, and z backwards, for it looks against that.
    axes = np.array([[0.0, s, -c], [-1.0, 0.0, 0.0], [0.0, c, s]])
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    place = [mount.x, mount.y, mount.z]
    body.add_camera(name="vehicle/camera", pos=place, quat=quat, fovy=mount.fovy_deg)


def _three(size: ArrayLike) -> NDArray[np.float64]:
    """The size with zeros for the numbers that a shape does not have."""
    given = np.asarray(size, dtype=np.float64)
    return np.concatenate([given, np.zeros(3 - len(given))])


BATTERY_V: Final = 7.2
"""Six cells of NiMH, the usual battery of cars of this size."""

_KGF_CM: Final = 0.0980665  # N·m
_RPM: Final = 2.0 * math.pi / 60.0  # rad/s


@dataclass(frozen=True, slots=True)
class DcMotor:
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

    def geared(self, ratio: float, efficiency: float = 1.0) -> DcMotor:
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
) -> DcMotor:
    resistance = volts / stall_a
    return DcMotor(
        resistance=resistance,
        volts_per_speed=(volts - free_a * resistance) / (free_rpm * _RPM),
        torque_per_current=stall_kgf_cm * _KGF_CM / stall_a,
        free_a=free_a,
        rotor_inertia=rotor_inertia,
    )


@dataclass(frozen=True, slots=True)
class ServoMotor:
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

HOBBY_SERVO: Final = ServoMotor(
    # Hitec HS-311 at 4.8 V: 3.0 kgf·cm, 60 degrees in 0.19 s, by its data sheet.
    stall_torque=3.0 * _KGF_CM,
    free_rate=math.radians(60.0) / 0.19,
)


class MotorDrive:
    """A motor in the simulation: it turns the mean of some joints, which a tendon takes.

    Args:
        model: Model of everything.
        data: State of everything.
        name: Of the actuator and of the tendon.
        motor: What it is.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, name: str, motor: DcMotor
    ) -> None:
        self._motor = motor
        self._actuator = int(model.actuator(name).id)
        self._tendon = int(model.tendon(name).id)
        self._ctrl = data.ctrl
        self._velocity = data.ten_velocity
        self._angle = data.ten_length
        self._is_open = False

    def set(self, value: float | None, battery_v: float) -> None:
        """Give it a share of the battery; without a connection it runs along."""
        self._is_open = value is None
        self._ctrl[self._actuator] = (
            self._motor.volts_per_speed * self._velocity[self._tendon]
            if value is None
            else min(1.0, max(-1.0, value)) * battery_v
        )

    def current_a(self) -> float:
        """What it draws, A."""
        if self._is_open:
            return 0.0
        return self._motor.amperes(float(self._ctrl[self._actuator]), self.rate())

    def turned(self) -> float:
        """Angle of its shaft, rad."""
        return float(self._angle[self._tendon])

    def rate(self) -> float:
        """Speed of its shaft, rad/s."""
        return float(self._velocity[self._tendon])


def joints_below_chassis(model: mujoco.MjModel) -> tuple[tuple[int, int], ...]:
    """Place in qpos and in qvel of each joint of the vehicle but those that carry it about."""
    return tuple(
        (int(joint.qposadr[0]), int(joint.dofadr[0]))
        for joint in map(model.joint, range(model.njnt))
        if joint.name.startswith("vehicle/") and not joint.name.startswith("vehicle/chassis")
    )


def settle(model: mujoco.MjModel, data: mujoco.MjData, joints: tuple[tuple[int, int], ...]) -> None:
    """Set these joints to 0 at rest, let no motor pull, and work out what follows."""
    for qpos, qvel in joints:
        data.qpos[qpos] = 0.0
        data.qvel[qvel] = 0.0
    data.ctrl[:] = 0.0
    data.qfrc_applied[:] = 0.0
    data.qacc_warmstart[:] = 0.0
    mujoco.mj_forward(model, data)
