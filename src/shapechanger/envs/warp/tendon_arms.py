"""Tendons over joints whose moment arms differ between worlds.

mujoco-warp 4.0 keeps the moment arms of fixed tendons, `wrap_prm`, once for all worlds. Its kernel
is replaced by one that finds the arms of each world behind one another, or those of all.
"""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

from typing import Any

from shapechanger.envs.warp.devices import mjw, wp


@wp.kernel
def _joint_tendon(
    jnt_qposadr: wp.array[int],
    jnt_dofadr: wp.array[int],
    ten_J_rownnz: wp.array[int],
    ten_J_rowadr: wp.array[int],
    ten_J_colind: wp.array[int],
    wrap_objid: wp.array[int],
    wrap_prm: wp.array[float],
    tendon_jnt_adr: wp.array[int],
    wrap_jnt_adr: wp.array[int],
    qpos_in: wp.array2d[float],
    ten_J_out: wp.array2d[float],
    ten_length_out: wp.array2d[float],
):
    """Add a joint's part to the length of a tendon, and write its part of the moment arms."""
    worldid, wrapid = wp.tid()
    tenid = tendon_jnt_adr[wrapid]
    wrapjntid = wrap_jnt_adr[wrapid]
    joint = wrap_objid[wrapjntid]
    arm = wrap_prm[(worldid * wrap_objid.shape[0]) % wrap_prm.shape[0] + wrapjntid]
    wp.atomic_add(ten_length_out[worldid], tenid, arm * qpos_in[worldid, jnt_qposadr[joint]])
    dofadr = jnt_dofadr[joint]
    rowadr = ten_J_rowadr[tenid]
    for k in range(ten_J_rownnz[tenid]):
        if ten_J_colind[rowadr + k] == dofadr:
            ten_J_out[worldid, rowadr + k] = arm
            break


def follow_arms() -> None:
    """Let mujoco-warp read the moment arms of each world."""
    mjw._src.smooth._joint_tendon = _kernel


def _kernel(deterministic: bool = False) -> Any:
    """Return the kernel, in the place of one that adds in the same order each time."""
    return _joint_tendon
