"""Land vehicles: their chassis, rolling wheels, and Ackermann steering of the front ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco

from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs
from shapechanger.vehicles.bodies.parts import (
    HOBBY_SERVO,
    CameraMount,
    DcMotor,
    add_camera,
    add_hull,
    add_look,
    add_wheel,
)
from shapechanger.vehicles.bodies.visuals import Paint, add_shadow, dress

_SIDES = (("left", 1), ("right", -1))


@dataclass(frozen=True, slots=True)
class Axles:
    """Dimensions of two axles, the front one with Ackermann steering.

    Attributes:
        front_x: Position of the front axle, m ahead of the origin.
        rear_x: Position of the rear axle, m; negative.
        gauge: Distance between the wheels of an axle, m.
        radius: Wheel radius, m.
        width: Wheel width, m.
        wheel_kg: Mass of a wheel.
        full_lock: Steering angle at an output of 1, for a wheel in the middle of the axle, rad.
    """

    front_x: float
    rear_x: float
    gauge: float
    radius: float
    width: float
    wheel_kg: float
    full_lock: float

    @property
    def wheelbase(self) -> float:
        """Distance between the axles, m."""
        return self.front_x - self.rear_x

    @property
    def turning_radius(self) -> float:
        """Radius of the origin's path at full lock, m."""
        return math.hypot(self.wheelbase / math.tan(self.full_lock), self.rear_x)

    def angles(self, steering: float) -> tuple[float, float]:
        """Angles of the left and the right wheel, rad, positive to the left.

        All wheels roll around one point on the line of the rear axle (Ackermann's condition).

        Args:
            steering: Output from -1, left, to 1, right.
        """
        curvature = math.tan(-steering * self.full_lock) / self.wheelbase
        along, half = self.wheelbase * curvature, curvature * self.gauge / 2
        return math.atan(along / (1.0 - half)), math.atan(along / (1.0 + half))


def add_chassis(
    spec: mujoco.MjSpec,
    paint: Paint,
    length_m: float,
    width_m: float,
    hull_z: float,
    mass: float,
    camera: CameraMount,
    *,
    seen: Sequence[tuple[mujoco.mjtGeom, Sequence[float], Sequence[float], str]] = (),
    shadow_m: float | None = None,
) -> mujoco.MjsBody:
    """Add the body of a land vehicle, which moves freely, with its hull, looks and camera.

    Args:
        spec: Model to extend.
        paint: Materials and meshes.
        length_m: Length of the hull, m.
        width_m: Width of the hull, m.
        hull_z: Height of its middle, m.
        mass: Mass without wheels, kg.
        camera: Mount of its camera.
        seen: What its own camera sees: shape, position, size and colour of each geom.
        shadow_m: Width of its shadow, m; None for that of the hull.
    """
    chassis = spec.worldbody.add_body(name="vehicle/chassis")
    chassis.add_freejoint(name="vehicle/chassis")
    half, size = 0.5 * length_m, (0.5 * length_m, 0.5 * width_m, 0.025)
    box = mujoco.mjtGeom.mjGEOM_BOX
    add_hull(chassis, "vehicle/hull", box, (0.0, 0.0, hull_z), size, mass)
    for shape, pos, sizes, colour in seen:
        add_look(chassis, shape, pos, sizes, paint(colour))
    dress(chassis, "chassis", paint)
    aside = 0.5 * (width_m if shadow_m is None else shadow_m)
    add_shadow(chassis, (-half, -aside), (half, aside), paint)
    add_camera(chassis, camera)
    return chassis


def add_axles(
    spec: mujoco.MjSpec, chassis: mujoco.MjsBody, axles: Axles, motor: DcMotor, paint: Paint
) -> None:
    """Add four wheels, the steering servo and the motor of the rear axle.

    The rear axle has a differential, modelled by a fixed tendon: its wheels share the torque, and
    their mean speed is the motor's.

    Args:
        spec: Model to extend.
        chassis: Body of the vehicle.
        axles: Dimensions.
        motor: Motor of the rear axle.
        paint: Materials of the wheels.
    """
    size = (axles.radius, axles.width, axles.wheel_kg)
    axle = motor.add(spec, "vehicle/wheels")
    for side, sign in _SIDES:
        y = sign * axles.gauge / 2
        knuckle = chassis.add_body(
            name=f"vehicle/{side} knuckle", pos=[axles.front_x, y, axles.radius]
        )
        name = f"vehicle/{side} steering"
        knuckle.add_joint(
            name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 0.0, 1.0],
            damping=HOBBY_SERVO.damping / 2, armature=2e-4,
        )  # fmt: skip
        knuckle.explicitinertial = True
        knuckle.mass = 0.01
        knuckle.inertia = [1e-6, 1e-6, 1e-6]
        HOBBY_SERVO.add(spec, name, name, share=0.5)
        add_wheel(knuckle, f"vehicle/front {side} wheel", (0.0, 0.0, 0.0), *size, paint)
        rear = f"vehicle/rear {side} wheel"
        place = (axles.rear_x, y, axles.radius)
        add_wheel(chassis, rear, place, *size, paint, armature=motor.rotor_inertia / 2)
        axle.wrap_joint(rear, 0.5)


class Rolling(BoundVehicle):
    """A vehicle on land.

    Args:
        model: Compiled model with the vehicle.
        data: Its state.
        motors: See `BoundVehicle`.
        radius: Radius of the driven wheels, m.
        axles: Its axles with Ackermann steering; None for tracks.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        motors: Mapping[str, DcMotor],
        radius: float,
        axles: Axles | None = None,
    ) -> None:
        super().__init__(model, data, motors)
        self._radius = radius
        root = model.joint("vehicle/chassis")
        self._qpos0, self._qvel0 = int(root.qposadr[0]), int(root.dofadr[0])
        self._axles, self._steering = axles, 0.0
        if axles is not None:
            names = (f"vehicle/{side} steering" for side, _ in _SIDES)
            self._servos = [model.actuator(name).id for name in names]

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        self._steering = 0.0
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors and the angles of the front wheels."""
        super().drive(outputs, battery_v)
        steering = outputs.get("steering", 0.0)
        if self._axles is None or steering is None or steering == self._steering:
            return
        self._steering = steering
        angles = self._axles.angles(min(1.0, max(-1.0, steering)))
        for servo, angle in zip(self._servos, angles, strict=True):
            self._ctrl[servo] = angle

    def motion(self) -> Motion:
        """Current pose and velocity."""
        p, v = self._qpos0, self._qvel0
        x, y, _, qw, qx, qy, qz = self._qpos[p : p + 7].tolist()
        vx, vy, _, _, _, yaw_rate = self._qvel[v : v + 6].tolist()
        heading = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        cosine, sine = math.cos(heading), math.sin(heading)
        return Motion(x, y, heading, vx * cosine + vy * sine, vy * cosine - vx * sine, yaw_rate)

    def travelled_m(self) -> float:
        """Mean distance that the driven wheels rolled since `place`, m."""
        turned = sum([drive.turned() for drive in self._drives.values()])
        return self._radius * turned / len(self._drives)
