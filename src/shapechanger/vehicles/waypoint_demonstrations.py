"""Demonstrations of steering as demonstrations of waypoints, which every vehicle can follow."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.dataset import Dataset
from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.errors import DemosError, StudyError
from shapechanger.layout import Layout
from shapechanger.vehicles.cameras.rectify import HALF_WIDTH_RAD, CameraGeometry, Rectifier
from shapechanger.vehicles.waypoints import (
    ACTION_LAYOUT,
    WIDEST_RAD,
    SteeringResponse,
    fit_response,
    waypoints_of,
)

_COMMANDS: Final = ("steering", "throttle")
_MOTION: Final = ("steering/applied", "speed", "yaw_rate")
_MEASURE: Final = (
    "give --response RAD_PER_M RAD_PER_S, the `response` of RemoteWaypoint-v1 after its first reset"
)


@dataclass
class CanonicalView:
    """Warps pictures to the virtual camera of all vehicles.

    Attributes:
        camera: Pitch and vertical field of view of the camera, degrees; None for those that each
            episode states.
        rectifiers: Those used so far, by camera and size of its pictures.
        bodies: Bodies of the episodes.
    """

    camera: CameraGeometry | None = None
    rectifiers: dict[tuple[CameraGeometry, tuple[int, int]], Rectifier] = field(
        default_factory=dict[tuple[CameraGeometry, tuple[int, int]], Rectifier]
    )
    bodies: set[str] = field(default_factory=set[str])

    def __call__(self, picture: NDArray[np.uint8], header: EpisodeHeader) -> NDArray[np.uint8]:
        """Return a picture of an episode as the virtual camera would have taken it.

        Pictures of episodes whose actions are waypoints are so already.

        Raises:
            DemosError: If the camera is unknown, the actions are not those of a vehicle, or the
                episodes are of several bodies.
            WorldError: If the camera does not see what the virtual camera sees.
        """
        self.bodies.add(header.body)
        if len(self.bodies) > 1:
            raise DemosError(
                f"These demonstrations are of several bodies, {', '.join(sorted(self.bodies))}, "
                "which turn differently: learn from one at a time."
            )
        if Layout.from_json(header.action_layout).names == ACTION_LAYOUT.names:
            return picture
        size = picture.shape[1], picture.shape[0]
        key = self.camera or _camera_of(header), size
        if key not in self.rectifiers:
            self.rectifiers[key] = Rectifier(*key)
        return self.rectifiers[key](picture)

    def note(self) -> str:
        """Return a sentence on the cameras."""
        cameras = sorted({(one.pitch_deg, one.fovy_deg) for one, _ in self.rectifiers})
        each = " and ".join(
            f"looks {pitch:.3g} degrees down with a vertical field of view of {fovy:.3g}"
            for pitch, fovy in cameras
        )
        return f"Pictures are warped to the camera of all vehicles; the one that took them {each}."


def _camera_of(header: EpisodeHeader) -> CameraGeometry:
    pitch, fovy = header.camera_pitch_deg, header.camera_fovy_deg
    if pitch is None or fovy is None:
        raise DemosError(
            "The recording does not state pitch and field of view of its camera: give --camera "
            "PITCH FOVY, in degrees, which `shapechanger robot camera` measures."
        )
    return camera_geometry(pitch, fovy)


def camera_geometry(pitch_deg: float, fovy_deg: float) -> CameraGeometry:
    """Return how a camera looks at the world.

    Args:
        pitch_deg: Angle of its optical axis below the horizon, degrees.
        fovy_deg: Its vertical field of view, degrees.

    Raises:
        DemosError: If there is no such camera.
    """
    if not (abs(pitch_deg) < 90.0 and 0.0 < fovy_deg < 180.0):
        raise DemosError(
            f"A camera's pitch is from -90 to 90 degrees and its field of view from 0 to 180, got "
            f"{pitch_deg:g} and {fovy_deg:g}."
        )
    return CameraGeometry(pitch_deg, fovy_deg)


class WaypointDemonstrations(NamedTuple):
    """Demonstrations with waypoints as actions.

    Attributes:
        data: The demonstrations.
        kept: Which of the given steps they are, shape (n,).
        response: How the vehicle that was driven turns.
        notes: Sentences on what was done.
    """

    data: Dataset
    kept: NDArray[np.bool_]
    response: SteeringResponse
    notes: tuple[str, ...]


def as_waypoints(data: Dataset, response: SteeringResponse | None = None) -> WaypointDemonstrations:
    """Return demonstrations of steering and throttle as demonstrations of waypoints.

    Steps that do not say where the way is are left out; see `waypoints_of`.

    Args:
        data: The demonstrations, with rectified pictures.
        response: How the vehicle turns; None to fit it to the recorded motion.

    Raises:
        DemosError: If the actions are others, there are no pictures, the response or the speed is
            unknown, or no step is left.
    """
    names = data.action_layout.names
    if names == ACTION_LAYOUT.names:
        raise DemosError("These demonstrations have waypoints as actions: leave out --waypoints.")
    if names != _COMMANDS:
        raise DemosError(
            f"Waypoints follow from steering and throttle, and these demonstrations have the "
            f"actions {', '.join(names)}."
        )
    if data.pictures is None:
        raise DemosError("These demonstrations have no pictures, and waypoints are seen in them.")
    source = "as given"
    if response is None:
        response, source = _fitted(data), "fitted to the recorded motion"
    labels = waypoints_of(data.actions, response, _speed(data, response))
    kept = labels.usable
    if not kept.any():
        raise DemosError("In no step of these demonstrations does the vehicle drive forward.")
    ends = np.cumsum(data.episodes)
    lengths = [int(part.sum()) for part in np.split(kept, ends[:-1])]
    beside = np.abs(labels.actions[kept, 0]) * WIDEST_RAD > HALF_WIDTH_RAD
    notes = (
        f"The vehicle turns {response.per_metre:.2f} rad for each metre and "
        f"{response.per_second:.2f} for each second at full steering, {source}.",
        f"{np.mean(~kept):.1%} of the steps are left out: it stands still, drives backward, or did "
        "not measure its speed.",
        f"{np.mean(beside):.1%} of the waypoints are beside the picture, which ends "
        f"{math.degrees(HALF_WIDTH_RAD):.0f} degrees to each side; "
        f"{np.mean(labels.at_limit[kept]):.1%} are at the limit of the steering, so that the way "
        "may be farther aside.",
    )
    converted = dataclasses.replace(
        data,
        pictures=data.pictures[kept],
        states=None,
        actions=labels.actions[kept],
        episodes=tuple(length for length in lengths if length),
        times_s=data.times_s[kept],
        files=tuple(file for file, keep in zip(data.files, kept, strict=True) if keep),
        action_layout=ACTION_LAYOUT,
        state_layout=None,
    )
    return WaypointDemonstrations(converted, kept, response, notes)


def _fitted(data: Dataset) -> SteeringResponse:
    """Fit the response to the recorded motion."""
    names = () if data.state_layout is None else data.state_layout.names
    missing = [name for name in _MOTION if name not in names]
    if missing:
        raise DemosError(
            f"How the vehicle turns is unknown, because the recording lacks {', '.join(missing)}: "
            f"{_MEASURE}."
        )
    try:
        steering, speed, yaw_rate = (_column(data, name) for name in _MOTION)
        return fit_response(steering, speed, yaw_rate, data.times_s)
    except StudyError as error:
        raise DemosError(f"{str(error).rstrip('.')}: {_MEASURE}.") from error


def _speed(data: Dataset, response: SteeringResponse) -> NDArray[np.float64]:
    """Return the speed at each step, m/s; NaN where it is unknown."""
    if data.state_layout is not None and "speed" in data.state_layout.names:
        return _column(data, "speed")
    if response.per_second > 0.0:
        raise DemosError(
            "The recording has no speed, on which the waypoint depends in a vehicle that turns "
            f"{response.per_second:g} rad for each second: record it with a sensor of speed."
        )
    # The circle of wheels does not depend on the speed; with a throttle they roll forward.
    return np.where(data.actions[:, 1] > 0.0, 1.0, np.nan)


def _column(data: Dataset, name: str) -> NDArray[np.float64]:
    if data.states is None or data.state_layout is None:
        raise DemosError(f"The recording has no {name}.")
    return data.states[:, data.state_layout.slices[name].start].astype(np.float64)
