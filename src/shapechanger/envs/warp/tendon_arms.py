"""Tendons over joints whose moment arms differ between worlds.

mujoco-warp 4.0 keeps the moment arms of fixed tendons, `wrap_prm`, once for all worlds. What it
computes from them is written again, with the arms of each world.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

from typing import Any

from shapechanger.envs.warp.devices import mjw, wp

_theirs: Any = mjw._src.smooth.tendon


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
    own = world * joints.shape[0]  # Its world's arms are behind those of the worlds before.
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


def follow_arms() -> None:
    """Let mujoco-warp compute tendons with the moment arms of each world."""
    mjw._src.smooth.tendon = _tendon


def _tendon(model: Any, data: Any) -> None:
    """Compute the tendons, and again where each world has arms of its own."""
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
