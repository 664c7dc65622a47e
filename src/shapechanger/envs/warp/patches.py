"""Replacements of functions in mujoco-warp 4.0 that differ from MuJoCo or ignore differing bodies.

- **Contacts of capsules with planes.** MuJoCo turns the pyramid of friction of such a contact along
  the capsule. mujoco-warp does so only where the capsule leans by more than 30 degrees from the
  plane's normal, and along the world's axes for steeper ones, which turns the pyramid by up to 45
  degrees: an ant's step with a steep shank on the floor then differs by a third in some velocities.
  With elliptic cones, whose friction has no direction, both agree to 1e-5, so nothing else differs.
- **Moment arms.** mujoco-warp keeps the arms of fixed tendons, `wrap_prm`, once for all worlds.

Both replace private functions, and so only of the version whose code they were written for;
`tests/envs/warp/test_patches.py` fails as soon as a version needs one no longer.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

from importlib.metadata import version
from typing import Any, Final

from shapechanger.envs.warp.devices import mjw, wp
from shapechanger.errors import VectorEnvError

VERSION: Final = "4.0."
"""Beginning of the versions of mujoco-warp that these functions belong to."""

_core: Any = mjw._src.collision_primitive_core
plane_sphere: Any = _core.plane_sphere
normalize_with_norm: Any = _core.normalize_with_norm
mat23f: Any = mjw._src.types.mat23f
_theirs: Any = mjw._src.smooth.tendon


def follow_mujoco() -> None:
    """Let mujoco-warp's kernels, which are built later, use the functions of this module.

    Raises:
        VectorEnvError: If another version is installed.
    """
    if not (found := version("mujoco-warp")).startswith(VERSION):
        raise VectorEnvError(
            f"backend='warp' corrects functions of mujoco-warp {VERSION}x, and {found} is "
            f"installed: run `pip install 'mujoco-warp=={VERSION}*'`."
        )
    mjw._src.collision_primitive.plane_capsule = plane_capsule
    mjw._src.smooth.tendon = _tendon


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


@wp.kernel
def _write_tendon(
    first: wp.array[int],
    count: wp.array[int],
    joints: wp.array[int],
    arms: wp.array[float],
    angle_of: wp.array[int],
    dof_of: wp.array[int],
    row_of: wp.array[int],
    entries: wp.array[int],
    columns: wp.array[int],
    angles: wp.array2d[float],
    jacobian: wp.array2d[float],
    lengths: wp.array2d[float],
):
    """Write the length of a tendon in a world, the sum of arms by angles, and its derivative."""
    world, tendon = wp.tid()
    own = world * joints.shape[0]  # Its world's arms follow the previous worlds' arms.
    length = float(0.0)  # noqa: UP018  # Warp tells variables from constants by this.
    for i in range(first[tendon], first[tendon] + count[tendon]):
        length += arms[own + i] * angles[world, angle_of[joints[i]]]
    lengths[world, tendon] = length
    for entry in range(row_of[tendon], row_of[tendon] + entries[tendon]):
        derivative = float(0.0)  # noqa: UP018
        for i in range(first[tendon], first[tendon] + count[tendon]):
            if dof_of[joints[i]] == columns[entry]:
                derivative += arms[own + i]
        jacobian[world, entry] = derivative


def _tendon(model: Any, data: Any) -> None:
    """Compute the tendons, and again if each world has its own arms."""
    _theirs(model, data)
    if model.wrap_prm.size == data.nworld * model.wrap_objid.size and data.nworld > 1:
        wp.launch(
            _write_tendon,
            dim=(data.nworld, model.ntendon),
            inputs=[
                model.tendon_adr,
                model.tendon_num,
                model.wrap_objid,
                model.wrap_prm,
                model.jnt_qposadr,
                model.jnt_dofadr,
                model.ten_J_rowadr,
                model.ten_J_rownnz,
                model.ten_J_colind,
                data.qpos,
            ],
            outputs=[data.ten_J, data.ten_length],
        )
