"""Contacts of capsules with planes, with the axes of friction that MuJoCo gives them.

MuJoCo turns the pyramid of friction of such a contact along the capsule. mujoco-warp 4.0 does so
only where the capsule leans by more than 30 degrees from the plane's normal, and along the world's
axes for steeper ones, which turns the pyramid by up to 45 degrees: an ant's step with a steep shank
on the floor then differs by a third in some velocities. With elliptic cones, whose friction has no
direction, both agree to 1e-5, so nothing else differs.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

from typing import Any

from shapechanger.envs.warp.devices import mjw, wp

_core: Any = mjw._src.collision_primitive_core
plane_sphere: Any = _core.plane_sphere
normalize_with_norm: Any = _core.normalize_with_norm
mat23f: Any = mjw._src.types.mat23f


@wp.func
def plane_capsule(
    plane_normal: wp.vec3,
    plane_pos: wp.vec3,
    capsule_pos: wp.vec3,
    capsule_axis: wp.vec3,
    capsule_radius: float,
    capsule_half_length: float,
):
    """Return distances, places and frame of the contacts of both ends; see mujoco-warp's own."""
    n = plane_normal
    b, b_norm = normalize_with_norm(capsule_axis - n * wp.dot(n, capsule_axis))
    if b_norm < 1.0e-6:  # Upright, so that any direction will do.
        b = wp.vec3(0.0, 1.0, 0.0)
        if wp.abs(n[1]) > 0.5:
            b = wp.vec3(0.0, 0.0, 1.0)
        b, b_norm = normalize_with_norm(b - n * wp.dot(n, b))
    c = wp.cross(n, b)
    frame = wp.mat33(n[0], n[1], n[2], b[0], b[1], b[2], c[0], c[1], c[2])
    segment = capsule_axis * capsule_half_length
    dist1, pos1 = plane_sphere(n, plane_pos, capsule_pos + segment, capsule_radius)
    dist2, pos2 = plane_sphere(n, plane_pos, capsule_pos - segment, capsule_radius)
    places = mat23f(pos1[0], pos1[1], pos1[2], pos2[0], pos2[1], pos2[2])
    return wp.vec2(dist1, dist2), places, frame


def follow_capsules() -> None:
    """Let mujoco-warp's kernels, which are built later, use MuJoCo's axes."""
    mjw._src.collision_primitive.plane_capsule = plane_capsule
