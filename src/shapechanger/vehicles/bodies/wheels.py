"""Land vehicles: rolling wheels, and Ackermann steering of the front ones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs
from shapechanger.vehicles.bodies.parts import HOBBY_SERVO, DcMotor, add_wheel
from shapechanger.vehicles.bodies.visuals import Paint


class Rolling(BoundVehicle):
    """A vehicle on land, without steering.

    Args:
        model: Compiled model with the vehicle.
        data: Its state.
        motors: See `BoundVehicle`.
        radius: Radius of the driven wheels, m.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        motors: Mapping[str, DcMotor],
        radius: float,
    ) -> None:
        super().__init__(model, data, motors)
        self._radius = radius
        root = model.joint("vehicle/chassis")
        self._qpos0, self._qvel0 = int(root.qposadr[0]), int(root.dofadr[0])

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0

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


class Steered(Rolling):
    """A vehicle on land with Ackermann steering.

    Args:
        model: Compiled model with the vehicle.
        data: Its state.
        motors: See `Rolling`.
        axles: Dimensions of its axles.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        motors: Mapping[str, DcMotor],
        axles: Axles,
    ) -> None:
        super().__init__(model, data, motors, axles.radius)
        self._axles = axles
        self._servos = tuple(model.actuator(f"vehicle/{side} steering").id for side, _ in _SIDES)
        self._steering = 0.0

    def place(self, x: float, y: float, heading: float) -> None:
        """Put the vehicle at a pose, at rest and with straight wheels."""
        self._steering = 0.0
        super().place(x, y, heading)

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors and the angles of the front wheels."""
        super().drive(outputs, battery_v)
        steering = outputs.get("steering", 0.0)
        if steering is not None and steering != self._steering:
            self._steering = steering
            angles = self._axles.angles(min(1.0, max(-1.0, steering)))
            for servo, angle in zip(self._servos, angles, strict=True):
                self._ctrl[servo] = angle
