"""Land vehicles: a car, a tank and a truck, their wheels, and Ackermann steering."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import mujoco

from shapechanger.vehicles.bodies.model import BoundVehicle, Motion, Outputs, VehicleModel
from shapechanger.vehicles.bodies.parts import (
    HOBBY_MOTOR,
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

        All wheels roll around one point on the line of the rear axle (Ackermann's condition). The
        output is from -1, left, to 1.
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
    """Add the body of a land vehicle, which moves freely, with its hull, visuals and camera.

    `seen` lists shape, position, size and colour of each geom that its own camera sees. Sizes are
    in m; the mass, kg, is without wheels.
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
    """A vehicle on land."""

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


# Rounded sizes of a touring car at the scale 1:10; mass with battery and computer. Estimates.
_CAR_LENGTH: Final = 0.40  # m
_CAR_WIDTH: Final = 0.20  # m
_CAR_BODY_KG: Final = 1.3
_CAR_AXLES: Final = Axles(
    front_x=0.13,
    rear_x=-0.13,
    gauge=0.140,  # At full lock no wheel sticks out of the body.
    radius=0.0325,  # Tyres of 65 mm, the usual ones at 1:10.
    width=0.026,
    wheel_kg=0.05,
    full_lock=math.radians(28.0),
)

# Spur gear to the axle, chosen for 2 m/s; its efficiency is an estimate.
_CAR_MOTOR: Final = HOBBY_MOTOR.geared(4.3, efficiency=0.9)

_CAR_CAMERA: Final = CameraMount(x=0.055, y=0.0, z=0.118, pitch_rad=0.0)


def _build_car(spec: mujoco.MjSpec, paint: Paint) -> None:
    box, ellipsoid = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_ELLIPSOID
    # The bonnet, and the bumper of a camera that leans.
    seen = (
        (box, (0.19, 0.0, 0.038), (0.01, 0.095, 0.014), "dark"),
        (ellipsoid, (0.115, 0.0, 0.050), (0.088, 0.094, 0.027), "red"),
    )
    # The centre of mass is low. The hull is as wide as the wheels, so that it meets walls first.
    chassis = add_chassis(
        spec, paint, _CAR_LENGTH, _CAR_WIDTH, 0.045, _CAR_BODY_KG, _CAR_CAMERA, seen=seen
    )
    add_axles(spec, chassis, _CAR_AXLES, _CAR_MOTOR, paint)


CAR: Final = VehicleModel(
    name="car",
    drives=(frozenset({"wheels", "steering"}),),
    length_m=_CAR_LENGTH,
    width_m=_CAR_WIDTH,
    nose_m=_CAR_LENGTH / 2,
    camera=_CAR_CAMERA,
    top_speed_mps=2.0,
    turning_radius_m=_CAR_AXLES.turning_radius,
    build=_build_car,
    bind=partial(
        Rolling, motors={"wheels": _CAR_MOTOR}, radius=_CAR_AXLES.radius, axles=_CAR_AXLES
    ),
)


# Sizes of a toy tank at the scale 1:16 to 1:24; the mass is an estimate.
_TANK_LENGTH: Final = 0.32  # m
_TANK_WIDTH: Final = 0.24  # m
_TANK_BODY_KG: Final = 1.8
_TANK_GAUGE: Final = 0.19  # m between the middles of the tracks
_TANK_WHEEL_XS: Final = {"front": 0.095, "middle": 0.0, "rear": -0.095}  # m
_TANK_RADIUS: Final = 0.035  # m, over the track
_TANK_TRACK_WIDTH: Final = 0.04  # m
_TANK_WHEEL_KG: Final = 0.05

# Friction of hard plastic tracks on any ground, below that of rubber; an estimate. A tank turns by
# dragging its tracks sideways.
_TANK_TRACK_FRICTION: Final = 0.5

# Chosen for 1 m/s; the efficiency of gear and track is an estimate.
_TANK_MOTOR: Final = HOBBY_MOTOR.geared(9.7, efficiency=0.8)

_TANK_CAMERA: Final = CameraMount(x=0.12, y=0.0, z=0.115, pitch_rad=math.radians(3.0))


def _build_tank(spec: mujoco.MjSpec, paint: Paint) -> None:
    # In wide pictures its own camera sees the hull.
    box = mujoco.mjtGeom.mjGEOM_BOX
    seen = ((box, (0.0, 0.0, 0.058), (0.150, 0.072, 0.022), "green"),)
    chassis = add_chassis(
        spec, paint, _TANK_LENGTH, _TANK_WIDTH, 0.050, _TANK_BODY_KG, _TANK_CAMERA, seen=seen
    )
    for side, sign in _SIDES:
        # Three wheels that turn together.
        track = _TANK_MOTOR.add(spec, f"vehicle/{side} track")
        wheels = {where: f"vehicle/{side} {where} wheel" for where in _TANK_WHEEL_XS}
        for where, x in _TANK_WHEEL_XS.items():
            place = (x, sign * _TANK_GAUGE / 2, _TANK_RADIUS)
            add_wheel(
                chassis, wheels[where], place, _TANK_RADIUS, _TANK_TRACK_WIDTH, _TANK_WHEEL_KG,
                paint, armature=_TANK_MOTOR.rotor_inertia / 3, friction=_TANK_TRACK_FRICTION,
                tyre="track",
            )  # fmt: skip
            track.wrap_joint(wheels[where], 1 / 3)
        for where in ("front", "rear"):
            spec.add_equality(
                name=wheels[where],
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=wheels[where],
                name2=wheels["middle"],
                data=[0.0, 1.0, *[0.0] * 10],
            )


TANK: Final = VehicleModel(
    name="tank",
    drives=(frozenset({"left track", "right track"}),),
    length_m=_TANK_LENGTH,
    width_m=_TANK_WIDTH,
    nose_m=_TANK_LENGTH / 2,
    camera=_TANK_CAMERA,
    top_speed_mps=1.0,
    turning_radius_m=0.0,
    build=_build_tank,
    bind=partial(
        Rolling, motors={f"{side} track": _TANK_MOTOR for side, _ in _SIDES}, radius=_TANK_RADIUS
    ),
)


# Sizes of a tractor and a semi-trailer at the scale 1:14, shortened; masses are estimates.
_TRUCK_TRACTOR_LENGTH: Final = 0.50  # m
_TRUCK_TRAILER_LENGTH: Final = 0.50  # m
_TRUCK_WIDTH: Final = 0.20  # m
_TRUCK_TRACTOR_KG: Final = 2.4
_TRUCK_TRAILER_KG: Final = 1.2
_TRUCK_AXLES: Final = Axles(
    front_x=0.17,
    rear_x=-0.15,
    gauge=0.132,  # At full lock no wheel sticks out of the body.
    radius=0.0375,
    width=0.028,
    wheel_kg=0.07,
    full_lock=math.radians(30.0),
)
_TRUCK_HITCH_X: Final = -0.14  # m: a little ahead of the rear axle, as on real tractors.
_TRUCK_HITCH_Z: Final = 0.085  # m
_TRUCK_TRAILER_FRONT: Final = 0.05  # m of the trailer ahead of the hitch
_TRUCK_TRAILER_GAUGE: Final = 0.165  # m
_TRUCK_TRAILER_AXLE_X: Final = -0.36  # m behind the hitch
_TRUCK_MOST_YAW: Final = math.radians(85.0)  # The trailer meets the cab.
_TRUCK_MOST_PITCH: Final = math.radians(12.0)

# Chosen for 1.5 m/s.
_TRUCK_MOTOR: Final = HOBBY_MOTOR.geared(6.75, efficiency=0.9)

_TRUCK_CAMERA: Final = CameraMount(x=0.235, y=0.0, z=0.125, pitch_rad=math.radians(4.0))


def _build_truck(spec: mujoco.MjSpec, paint: Paint) -> None:
    chassis = add_chassis(
        spec,
        paint,
        _TRUCK_TRACTOR_LENGTH,
        _TRUCK_WIDTH,
        0.050,
        _TRUCK_TRACTOR_KG,
        _TRUCK_CAMERA,
        shadow_m=0.18,
    )
    add_axles(spec, chassis, _TRUCK_AXLES, _TRUCK_MOTOR, paint)
    _add_trailer(spec, chassis, paint)


def _add_trailer(spec: mujoco.MjSpec, chassis: mujoco.MjsBody, paint: Paint) -> None:
    """Add the trailer with its kingpin, which allows yaw and pitch but no roll."""
    box, hinge = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtJoint.mjJNT_HINGE
    trailer = chassis.add_body(name="vehicle/trailer", pos=[_TRUCK_HITCH_X, 0.0, _TRUCK_HITCH_Z])
    unit = 1.0 if not spec.compiler.degree else math.degrees(1.0)  # Unit of angles in the model.
    # Damping of the greased plate: estimates.
    trailer.add_joint(
        name="vehicle/trailer yaw", type=hinge, axis=[0.0, 0.0, 1.0], damping=0.01, limited=True,
        range=[-unit * _TRUCK_MOST_YAW, unit * _TRUCK_MOST_YAW],
    )  # fmt: skip
    trailer.add_joint(
        name="vehicle/trailer pitch", type=hinge, axis=[0.0, 1.0, 0.0], damping=0.02, limited=True,
        range=[-unit * _TRUCK_MOST_PITCH, unit * _TRUCK_MOST_PITCH],
    )  # fmt: skip
    half = _TRUCK_TRAILER_LENGTH / 2
    x = _TRUCK_TRAILER_FRONT - half
    add_hull(
        trailer,
        "vehicle/trailer",
        box,
        (x, 0.0, 0.025),
        (half, _TRUCK_WIDTH / 2, 0.02),
        _TRUCK_TRAILER_KG,
    )
    dress(trailer, "trailer", paint, ground_z=-_TRUCK_HITCH_Z)
    rear, front = (x - half, -_TRUCK_WIDTH / 2), (x + half - 0.08, _TRUCK_WIDTH / 2)
    add_shadow(trailer, rear, front, paint, ground_z=-_TRUCK_HITCH_Z)
    for side, sign in (("left", 1), ("right", -1)):
        place = (
            _TRUCK_TRAILER_AXLE_X,
            sign * _TRUCK_TRAILER_GAUGE / 2,
            _TRUCK_AXLES.radius - _TRUCK_HITCH_Z,
        )
        size = (_TRUCK_AXLES.radius, _TRUCK_AXLES.width, _TRUCK_AXLES.wheel_kg)
        add_wheel(trailer, f"vehicle/trailer {side} wheel", place, *size, paint)


TRUCK: Final = VehicleModel(
    name="truck",
    drives=(frozenset({"wheels", "steering"}),),
    optional_parts=frozenset({"gear", "bed"}),
    length_m=_TRUCK_TRACTOR_LENGTH / 2
    - _TRUCK_HITCH_X
    + _TRUCK_TRAILER_LENGTH
    - _TRUCK_TRAILER_FRONT,
    width_m=_TRUCK_WIDTH,
    nose_m=_TRUCK_TRACTOR_LENGTH / 2,
    camera=_TRUCK_CAMERA,
    top_speed_mps=1.5,
    turning_radius_m=_TRUCK_AXLES.turning_radius,
    build=_build_truck,
    bind=partial(
        Rolling, motors={"wheels": _TRUCK_MOTOR}, radius=_TRUCK_AXLES.radius, axles=_TRUCK_AXLES
    ),
)
