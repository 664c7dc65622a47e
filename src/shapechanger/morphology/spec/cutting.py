"""Cut a segment at a plane across it: what lies nearer, what lies farther, what is cut in two."""

from __future__ import annotations

from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.geometry import (
    ALONG,
    LONG,
    Array,
    Point,
    anchor,
    axis_ends,
    far_end,
    has_ends,
    held_at,
    orientation,
    place_of,
    rotation,
    same_density,
)

# Shares of a length that differ by less are the same; rounding must not decide on which side of a
# cut a point lies.
_SAME: Final = 1e-9


class NearPart(NamedTuple):
    """The part of a geom that lies on the near side of a plane.

    Attributes:
        near: End of its axis on that side, in the body's frame, shape (3,), m.
        share: Share of its length on that side: 1 for all of the geom, 0 for nothing of it.
        axis: Index of the half-size that is its length.
    """

    near: Array
    share: float
    axis: int


class Plane:
    """A plane across a segment.

    Args:
        spec: Specification that contains the segment.
        body: The segment.
        part: Position of the plane as a share of the segment's length from its anchor.

    Attributes:
        along: From the anchor of the segment to its far end, in the body's frame, shape (3,), m.
        place: Where it crosses the axis of the segment, in the body's frame, shape (3,), m.

    Raises:
        MorphologyError: If the segment has no length.
    """

    def __init__(self, spec: mujoco.MjSpec, body: mujoco.MjsBody, part: float) -> None:
        self._spec, self._body, self._part = spec, body, part
        self._held = anchor(body)
        self.along = far_end(spec, body) - self._held
        self.place = self._held + part * self.along

    def _share(self, point: Array) -> float:
        """Return the position of a point along the segment as a share of its length."""
        return float((point - self._held) @ self.along) / float(self.along @ self.along)

    def _is_beyond(self, point: Array) -> bool:
        """Return whether a point of the body's frame, m, lies farther out than the plane."""
        return self._share(point) > self._part + _SAME

    def is_at_end(self, point: Point) -> bool:
        """Return whether a point of the segment is at its far end or past it."""
        return self._share(place_of(point)) > 1.0 - _SAME

    def children_beyond(self) -> list[mujoco.MjsBody]:
        """Return the bodies that are attached farther out than the plane."""
        return [c for c in self._body.bodies if self._is_beyond(held_at(self._spec, c))]

    def points_beyond(self) -> list[Point]:
        """Return the sites, cameras and lights of the segment farther out than the plane."""
        points = (*self._body.sites, *self._body.cameras, *self._body.lights)
        return [point for point in points if self._is_beyond(place_of(point))]

    def piece_of(self, geom: mujoco.MjsGeom) -> NearPart:
        """Return the part of a geom of the segment on the near side.

        A shape without a length goes to the side of its middle.

        Raises:
            MorphologyError: If the plane cuts a box that lies oblique to it.
        """
        ends, axis = self._ends(geom)
        if ends is None:
            return NearPart(place_of(geom), float(not self._is_beyond(place_of(geom))), axis)
        inner, outer = (self._share(end) for end in ends)
        near = ends[0]
        if inner > outer:
            near, inner, outer = ends[1], outer, inner
        if outer <= self._part + _SAME or inner >= self._part - _SAME:
            return NearPart(near, float(outer <= self._part + _SAME), axis)
        # Exact for a geom that spans the segment.
        if np.allclose(near, self._held, 0.0, _SAME):
            near, inner = self._held, 0.0
        outer = 1.0 if abs(outer - 1.0) < _SAME else outer
        return NearPart(near, (self._part - inner) / (outer - inner), axis)

    def _ends(self, geom: mujoco.MjsGeom) -> tuple[tuple[Array, Array] | None, int]:
        """Return both ends of a geom's length, and the index of the half-size that it is."""
        if geom.type in LONG:
            return axis_ends(self._spec, geom), 1
        if geom.type != mujoco.mjtGeom.mjGEOM_BOX:
            return None, 0
        if has_ends(geom):
            return (np.array(geom.fromto[:3]), np.array(geom.fromto[3:])), 2
        axes = rotation(orientation(self._spec, geom))
        along = np.abs(self.along @ axes) / float(np.linalg.norm(self.along))
        axis = int(np.argmax(along))
        if along[axis] >= ALONG:
            half = axes[:, axis] * geom.size[axis]
            return (geom.pos - half, geom.pos + half), axis
        signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, 8)
        corners = ((axes * geom.size) @ signs).T
        if len({self._is_beyond(geom.pos + corner) for corner in corners}) == 2:
            raise MorphologyError(
                f"{geom.name!r} lies oblique to the plane that would cut it in two: cut "
                f"{self._body.name!r} elsewhere."
            )
        return None, axis


def shorten(
    spec: mujoco.MjSpec, geom: mujoco.MjsGeom, held: Array, share: float, axis: int
) -> None:
    """Shorten a geom to a share of its length, at the same thickness and density.

    The end `held` of its axis stays; `axis` is the index of the half-size that is its length.
    """
    with same_density(spec, geom):
        if has_ends(geom):
            geom.fromto = (held + share * (geom.fromto.reshape(2, 3) - held)).ravel()
        else:
            size = np.array(geom.size)
            size[axis] *= share
            geom.size = size
            geom.pos = held + share * (geom.pos - held)
