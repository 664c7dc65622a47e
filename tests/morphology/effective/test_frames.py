"""Effective frames, compared with the kinematics of the simulation."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.morphology.effective.bodies import frames
from tests.morphology.scenes import asset, everything


def _assert_where(
    local: tuple[np.ndarray, np.ndarray],
    bodies: np.ndarray,
    data: mujoco.MjData,
    xpos: np.ndarray,
    xmat: np.ndarray,
) -> None:
    """Assert that the frames, relative to their bodies, are where the simulation has them."""
    positions, orientations = local
    for i, body in enumerate(bodies):
        turned = data.xmat[body].reshape(3, 3)
        np.testing.assert_allclose(data.xpos[body] + turned @ positions[i], xpos[i], atol=1e-9)
        own = np.zeros(9)
        mujoco.mju_quat2Mat(own, orientations[i])
        np.testing.assert_allclose(turned @ own.reshape(3, 3), xmat[i].reshape(3, 3), atol=1e-9)


@pytest.mark.parametrize("written", [False, True])
@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "pusher_v5", "everything"])
def test_frames_match_the_simulation(name: str, written: bool) -> None:
    """Frames match as compiled, and after writes to the arrays that place them."""
    model = everything() if name == "everything" else asset(name)
    random = np.random.default_rng(0)
    if written:
        for array in (model.body_ipos, model.geom_pos, model.site_pos):
            array += random.normal(size=array.shape)
        for array in (model.body_iquat, model.geom_quat, model.site_quat):
            array += random.normal(size=array.shape)
            array /= np.linalg.norm(array, axis=1, keepdims=True)
    data = mujoco.MjData(model)
    data.qpos += random.normal(scale=0.1, size=model.nq)
    mujoco.mj_kinematics(model, data)
    every_body = np.arange(model.nbody)
    _assert_where(frames(model, "inertia"), every_body, data, data.xipos, data.ximat)
    _assert_where(frames(model, "geom"), model.geom_bodyid, data, data.geom_xpos, data.geom_xmat)
    _assert_where(frames(model, "site"), model.site_bodyid, data, data.site_xpos, data.site_xmat)
