"""Warp kernels: random numbers of worlds, and replacements of functions of mujoco-warp.

A world's random numbers are a function of its seed and episode alone, not of its place in a batch
or of the number of worlds, and a GPU draws the same numbers as the CPU, up to the rounding of its
logarithm and cosine. They come from SplitMix64 as a function of a counter (Steele, Lea and Flood,
OOPSLA 2014), with 53 bits each.

Two private functions of mujoco-warp 4.0 differ from MuJoCo or ignore differing bodies:

- **Contacts of capsules with planes.** MuJoCo turns the pyramid of friction of such a contact along
  the capsule. mujoco-warp does so only if the capsule leans by more than 30 degrees from the
  plane's normal, and along the world's axes for steeper ones, which turns the pyramid by up to 45
  degrees: an ant's step with a steep shank on the floor then differs by a third in some velocities.
  With elliptic cones, whose friction has no direction, the two simulators agree to 1e-5.
- **Moment arms.** mujoco-warp keeps the arms of fixed tendons, `wrap_prm`, once for all worlds.

Both are replaced only in the version that the replacements were written for; other versions are
refused. A test in `tests/envs/warp/test_kernels.py` fails once a replacement is not needed.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

import math
from importlib.metadata import version
from typing import Any, Final

import torch
from torch import Tensor

from shapechanger.envs.warp.devices import as_warp, mjw, on, wp
from shapechanger.errors import VectorEnvError

VERSION: Final = "4.0."
"""Prefix of the versions of mujoco-warp that these functions were written for."""

_core: Any = mjw._src.collision_primitive_core
plane_sphere: Any = _core.plane_sphere
normalize_with_norm: Any = _core.normalize_with_norm
mat23f: Any = mjw._src.types.mat23f
_theirs: Any = mjw._src.smooth.tendon

_STEP: Any = wp.constant(wp.uint64(0x9E3779B97F4A7C15))
_FIRST: Any = wp.constant(wp.uint64(0xBF58476D1CE4E5B9))
_SECOND: Any = wp.constant(wp.uint64(0x94D049BB133111EB))
_UNIT: Any = wp.constant(wp.float64(2.0**-53))
_TURN: Any = wp.constant(wp.float64(2.0 * math.pi))


@wp.func
def _mixed(bits: wp.uint64):
    """Return the bits of a counter, mixed by SplitMix64."""
    bits = (bits ^ (bits >> wp.uint64(30))) * _FIRST
    bits = (bits ^ (bits >> wp.uint64(27))) * _SECOND
    return bits ^ (bits >> wp.uint64(31))


@wp.func
def _uniform(key: wp.uint64, place: int):
    """Return number `place` of a key, in [0, 1)."""
    bits = _mixed(key + wp.uint64(place + 1) * _STEP)
    return wp.float64(bits >> wp.uint64(11)) * _UNIT


@wp.kernel
def _draw(
    seeds: wp.array[wp.int64],
    episodes: wp.array[wp.int64],
    streams: wp.array[wp.int64],
    normal: bool,
    numbers: wp.array2d[wp.float64],
):
    """Write one number of one world; if `normal`, by the method of Box and Muller."""
    world, place = wp.tid()
    stream = wp.uint64(streams[world % streams.shape[0]])
    key = _mixed(_mixed(wp.uint64(seeds[world])) + wp.uint64(episodes[world]) * _STEP)
    key = _mixed(key + stream * _STEP)
    number = _uniform(key, place)
    if normal:
        radius = wp.sqrt(wp.float64(-2.0) * wp.log(wp.float64(1.0) - number))
        number = radius * wp.cos(_TURN * _uniform(key, numbers.shape[1] + place))
    numbers[world, place] = number


def uniforms(
    seeds: Tensor, episodes: Tensor, stream: int | Tensor, count: int, *, normal: bool = False
) -> Tensor:
    """Return numbers in [0, 1), or normally distributed ones, shape (n, count), float64.

    `seeds` and `episodes`, (n,), int64, are the seed of each world and how many episodes it has
    begun. `stream` is the number of an independent stream of the episode; an array has one per
    world, (n,), int64.
    """
    numbers = torch.empty((len(seeds), count), dtype=torch.float64, device=seeds.device)
    if isinstance(stream, int):
        # Filled on the device, so that no number is copied there.
        stream = torch.full((1,), stream, dtype=torch.int64, device=seeds.device)
    with on(str(seeds.device)):
        wp.launch(
            _draw,
            dim=(len(seeds), count),
            inputs=[*(as_warp(each, wp.int64) for each in (seeds, episodes, stream)), normal],
            outputs=[as_warp(numbers, wp.float64)],
        )
    return numbers


def follow_mujoco() -> None:
    """Let mujoco-warp's kernels, which are built later, use the functions of this module."""
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
    """Return distances, places and frame of the contacts of both ends, like mujoco-warp's own."""
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
    """Write a tendon's length in a world, the sum of arms times angles, and its derivative."""
    world, tendon = wp.tid()
    own = world * joints.shape[0]  # Offset of this world's arms.
    length = float(0.0)  # noqa: UP018  # Warp recognises variables by this call.
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
    """Compute the tendons as mujoco-warp does, and again if worlds have different arms."""
    _theirs(model, data)
    if model.wrap_prm.size == data.nworld * model.wrap_objid.size and data.nworld > 1:
        wp.launch(
            _write_tendon,
            dim=(data.nworld, model.ntendon),
            inputs=[
                *(model.tendon_adr, model.tendon_num, model.wrap_objid, model.wrap_prm),
                *(model.jnt_qposadr, model.jnt_dofadr, model.ten_J_rowadr, model.ten_J_rownnz),
                *(model.ten_J_colind, data.qpos),
            ],
            outputs=[data.ten_J, data.ten_length],
        )
