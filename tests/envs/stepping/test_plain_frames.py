"""Frames without shadows for learners, and with shadows for people."""

from __future__ import annotations

import pickle
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_SHADOW = mujoco.mjtRndFlag.mjRND_SHADOW


@pytest.mark.parametrize(
    ("size", "arguments", "shadows"),
    [
        (256, {}, False),
        (257, {}, True),
        (64, {"shadows": True}, True),
    ],
)
def test_small_frames_have_no_shadows(size: int, arguments: dict[str, Any], shadows: bool) -> None:
    """Frames of up to 256 pixels have no shadows by default; copies of the env render the same."""
    more = {"render_mode": "rgb_array", "width": size, "height": size, **arguments}
    with gym.make("shapechanger/Ant-v1", **more) as env:
        quality = env.unwrapped.model.vis.quality
        before = quality.offsamples, quality.shadowsize
        env.reset(seed=0)
        frame = env.render()
        assert (quality.offsamples, quality.shadowsize) == before
        viewer = env.unwrapped.mujoco_renderer.viewer
        assert bool(viewer.scn.flags[_SHADOW]) is shadows
        assert bool(viewer.con.offSamples) is shadows
        copies = [pickle.loads(pickle.dumps(env)), gym.make(env.spec)]
    for again in copies:
        again.reset(seed=0)
        np.testing.assert_array_equal(again.render(), frame)
        again.close()


def test_a_frame_shows_edited_colours() -> None:
    """Colours edited in the public model are rendered."""
    size = {"width": 64, "height": 64}
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **size) as env:
        env.reset(seed=0)
        before = env.render()
        env.unwrapped.model.mat_rgba[:] = env.unwrapped.model.geom_rgba[:] = (1.0, 0.0, 0.0, 1.0)
        assert (env.render() != before).any()
