"""Ground, water and a wall for tests of vehicles."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import mujoco

from shapechanger.vehicles.bodies import VehicleModel, add_vehicle
from shapechanger.vehicles.bodies.model import BoundVehicle
from shapechanger.vehicles.bodies.parts import BATTERY_V

LAND = ("car", "tank", "truck")
ALL = (*LAND, "boat")

# Outputs for full speed ahead; negative steering is to the left.
AHEAD: Mapping[str, Mapping[str, float]] = {
    "car": {"wheels": 1.0, "steering": 0.0},
    "truck": {"wheels": 1.0, "steering": 0.0},
    "tank": {"left track": 1.0, "right track": 1.0},
    "boat": {"propeller": 1.0, "rudder": 0.0},
}
TO_THE_LEFT: Mapping[str, Mapping[str, float]] = {
    "car": {"wheels": 0.5, "steering": -1.0},
    "truck": {"wheels": 0.5, "steering": -1.0},
    "tank": {"left track": -0.5, "right track": 0.5},
    "boat": {"propeller": 0.7, "rudder": -1.0},
}


@dataclass
class Ground:
    """A vehicle on flat ground or in water."""

    kind: VehicleModel
    model: mujoco.MjModel
    data: mujoco.MjData
    vehicle: BoundVehicle

    def drive(
        self, seconds: float, outputs: Mapping[str, float | None], battery_v: float | None = None
    ) -> None:
        volts = BATTERY_V if battery_v is None else battery_v
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.vehicle.drive(outputs, volts)
            mujoco.mj_step(self.model, self.data)

    def pace(self) -> float:
        """Return the speed over ground, m/s."""
        return math.hypot(self.vehicle.motion().speed, self.vehicle.motion().lateral_speed)

    def uprightness(self) -> float:
        """Return the cosine of the angle between the vehicle's upright axis and the world's."""
        return float(self.data.body("vehicle/chassis").xmat[8])

    def height(self) -> float:
        """Return the height of the origin above the ground, m."""
        return float(self.data.body("vehicle/chassis").xpos[2])


def ground(name: str, *, wall_x: float | None = None, friction: float = 1.0) -> Ground:
    """Return a vehicle at the origin, with an optional wall across the x axis."""
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(
        name="world/ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50.0, 50.0, 0.1],
        contype=4, conaffinity=8, friction=[friction, 0.005, 0.0001],
    )  # fmt: skip
    if wall_x is not None:
        spec.worldbody.add_geom(
            name="world/wall/0", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[wall_x + 0.05, 0.0, 0.5],
            size=[0.05, 10.0, 0.5], contype=1, conaffinity=2,
        )  # fmt: skip
    kind = add_vehicle(spec, name)
    model = spec.compile()
    data = mujoco.MjData(model)
    vehicle = kind.bind(model, data)
    vehicle.place(0.0, 0.0, 0.0)
    return Ground(kind, model, data, vehicle)
