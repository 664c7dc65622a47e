"""`RemoteWaypoint-v1`: a vehicle on the network with rectified images and waypoints as actions."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import RobotRefused
from shapechanger.robot.client.env import RemoteVehicleEnv
from shapechanger.robot.link.messages import Welcome
from shapechanger.vehicles.waypoints import SteeringResponse, WaypointView, measure_response


class RemoteWaypointEnv(WaypointView):
    """Drive a vehicle on the network by waypoints, with a policy from any other vehicle.

    The camera's frames are warped to the virtual camera of `WaypointEnv`, by the pitch and the
    field of view that the robot's profile states (`shapechanger robot camera` measures them). The
    env converts waypoints to steering by the vehicle's `SteeringResponse`. If neither `response`
    nor the profile gives the response, the first reset measures it: **the robot drives for 5 s with
    random commands**, at 0.4 to 0.8 of its throttle, without looking where it goes. Limits and
    reflexes of the guard still act. Put the robot on free ground for the measurement. The env then
    waits again until the operator has put the robot at the start.

    ## Reward
    That of `RemoteVehicleEnv`: metres forward, -10 for each collision, and -1 for each second in
    which the robot pushes without moving, as far as they are measured; `reward` replaces the
    weights.

    ## Start
    After a measurement of the response, if one is needed, that of `RemoteVehicleEnv`: once the
    operator has armed the robot, or its reset routine has run.

    ## End
    That of `RemoteVehicleEnv`: terminated by a collision, unless the reward is set otherwise;
    truncated when the link is lost, at an emergency stop, when the robot is disarmed and when
    another client takes control. `info["truncated_because"]` is the reason.

    ## Info
    The keys of `RemoteVehicleEnv`. `action_applied` has the steering and the throttle.

    ## Versions
    v1: the first.

    Args:
        robot: Name of a known robot, or its address, HOST or HOST:PORT.
        response: Turn for each metre, rad/m, and for each second, rad/s, at full steering, such as
            the attribute `response` of an earlier env; None to use the robot's profile or to
            measure the response in the first reset.
        **options: `key`, `fingerprint`, `pace`, `reward`, `on_reset`, `on_waiting`,
            `reset_timeout_s`, `timeout_s`, `interventions`, `role`, `name` and `render_mode` of
            `RemoteVehicleEnv`.

    Attributes:
        response: Response of the vehicle to steering; None before it is given or measured.

    Raises:
        RobotRefused: If the robot is not a vehicle, the geometry of its camera is unknown, its
            camera does not cover the virtual camera's view, or it does not measure its speed or,
            if the response is unknown, its rate of turn.
        StudyError: If the vehicle does not turn in the direction of the steering.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012  # Gymnasium's.

    def __init__(
        self, robot: str, *, response: tuple[float, float] | None = None, **options: Any
    ) -> None:
        self.response = None if response is None else SteeringResponse(*response)
        self._env = env = RemoteVehicleEnv(robot, size=None, image=True, state=True, **options)
        try:
            welcome = env.welcome
            if self.response is None and welcome.turning is not None:
                self.response = SteeringResponse(*welcome.turning)
            if (names := env.action_layout.names) != ("steering", "throttle"):
                raise RobotRefused(
                    f"Waypoints need steering and throttle, but {welcome.robot} has {names}."
                )
            sensors = ("speed", "yaw_rate")[: 1 + (self.response is None)]
            camera = *welcome.camera_deg, welcome.image_size
            on_the_spot = welcome.body == "tank"  # Only tracks turn a vehicle on the spot.
            self._see(
                env, welcome.robot, camera, sensors, RobotRefused, turns_on_the_spot=on_the_spot
            )
        except BaseException:
            env.close()
            raise

    @property
    def welcome(self) -> Welcome:
        """Description of the robot."""
        return self._env.welcome

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.uint8], dict[str, Any]]:
        """Measure the response if it is unknown, and bring the robot to the start.

        Raises a `StudyError` if the vehicle does not turn in the direction of the steering, and the
        errors of `RemoteVehicleEnv.reset`.
        """
        if self.response is None:
            self.response = measure_response(self._env, *self._motion_at)
        return super().reset(seed=seed, options=options)
