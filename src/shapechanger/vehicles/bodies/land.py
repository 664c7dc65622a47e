"""Land vehicles: a car, a tank and a truck; `models/` has their bodies."""

from __future__ import annotations

import math
from functools import partial
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs, VehicleModel
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR, CameraMount, DcMotor


class Rolling(BoundVehicle):
    """A vehicle on land.

    Args:
        model: Compiled model with the vehicle.
        data: Its state.
        motor: Motor of each driving part.
        full_lock: Steering angle at an output of 1, for a wheel in the middle of the front axle,
            rad; 0 for a vehicle without steering.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        motor: DcMotor,
        full_lock: float = 0.0,
    ) -> None:
        super().__init__(model, data, motor)
        root = model.joint("vehicle/chassis")
        self._qpos0, self._qvel0 = int(root.qposadr[0]), int(root.dofadr[0])
        geoms = map(model.geom, range(model.ngeom))
        self._radius = next(float(geom.size[0]) for geom in geoms if geom.name.endswith(" wheel"))
        self._full_lock, self._steering = full_lock, 0.0
        if full_lock:
            self._servos = [model.actuator(f"vehicle/{n} steering").id for n in ("left", "right")]
            knuckle, rear = (
                model.body("vehicle/left knuckle"),
                model.body("vehicle/rear left wheel"),
            )
            self._wheelbase = float(knuckle.pos[0] - rear.pos[0])
            self._half_gauge = float(knuckle.pos[1])

    def _place_chassis(self, x: float, y: float, heading: float) -> None:
        self._steering = 0.0
        p, v = self._qpos0, self._qvel0
        half = heading / 2
        self._qpos[p : p + 7] = (x, y, 0.0, math.cos(half), 0.0, 0.0, math.sin(half))
        self._qvel[v : v + 6] = 0.0

    def drive(self, outputs: Outputs, battery_v: float) -> None:
        """Set the voltages of the motors and the angles of the front wheels.

        All wheels roll around one point on the line of the rear axle (Ackermann's condition).
        """
        super().drive(outputs, battery_v)
        steering = outputs.get("steering", 0.0)
        if not self._full_lock or steering is None or steering == self._steering:
            return
        self._steering = steering
        angle = -min(1.0, max(-1.0, steering)) * self._full_lock
        curvature = math.tan(angle) / self._wheelbase
        along, half = self._wheelbase * curvature, curvature * self._half_gauge
        for servo, shorter in zip(self._servos, (half, -half), strict=True):
            self._ctrl[servo] = math.atan(along / (1.0 - shorter))

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
        # Each tendon measures the angle of one shaft, rad.
        return self._radius * sum(self._data.ten_length.tolist()) / len(self._drives)


# Spur gear to the axle, chosen for 2 m/s; its efficiency is an estimate.
_CAR_MOTOR: Final = HOBBY_MOTOR.geared(4.3, efficiency=0.9)
_CAR_LOCK: Final = math.radians(28.0)

CAR: Final = VehicleModel(
    name="car",
    drives=(frozenset({"wheels", "steering"}),),
    length_m=0.40,
    width_m=0.20,
    nose_m=0.20,
    camera=CameraMount(x=0.055, y=0.0, z=0.118, pitch_rad=0.0),
    top_speed_mps=2.0,
    turning_radius_m=math.hypot(0.26 / math.tan(_CAR_LOCK), 0.13),  # Wheelbase, and rear axle.
    motor=_CAR_MOTOR,
    bind=partial(Rolling, motor=_CAR_MOTOR, full_lock=_CAR_LOCK),
)

# Chosen for 1 m/s; the efficiency of gear and track is an estimate.
_TANK_MOTOR: Final = HOBBY_MOTOR.geared(9.7, efficiency=0.8)

TANK: Final = VehicleModel(
    name="tank",
    drives=(frozenset({"left track", "right track"}),),
    length_m=0.32,
    width_m=0.24,
    nose_m=0.16,
    camera=CameraMount(x=0.12, y=0.0, z=0.115, pitch_rad=math.radians(3.0)),
    top_speed_mps=1.0,
    turning_radius_m=0.0,
    motor=_TANK_MOTOR,
    bind=partial(Rolling, motor=_TANK_MOTOR),
)

# Chosen for 1.5 m/s.
_TRUCK_MOTOR: Final = HOBBY_MOTOR.geared(6.75, efficiency=0.9)
_TRUCK_LOCK: Final = math.radians(30.0)

TRUCK: Final = VehicleModel(
    name="truck",
    drives=(frozenset({"wheels", "steering"}),),
    optional_parts=frozenset({"gear", "bed"}),
    length_m=0.84,  # From the nose to the hitch, plus the trailer behind it.
    width_m=0.20,
    nose_m=0.25,
    camera=CameraMount(x=0.235, y=0.0, z=0.125, pitch_rad=math.radians(4.0)),
    top_speed_mps=1.5,
    turning_radius_m=math.hypot(0.32 / math.tan(_TRUCK_LOCK), 0.15),
    motor=_TRUCK_MOTOR,
    bind=partial(Rolling, motor=_TRUCK_MOTOR, full_lock=_TRUCK_LOCK),
)
