"""Smaller textures in envs without rendering."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

_PIXELS = ("tex_data", "tex_adr", "tex_width", "tex_height")


def _model(**arguments: Any) -> Any:
    with gym.make("shapechanger/Ant-v1", **arguments) as env:
        return env.unwrapped.model


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_only_textures_differ_without_rendering() -> None:
    """All other arrays equal an env's with rendering."""
    plain, drawn = _model(), _model(render_mode="rgb_array")
    assert plain.ntexdata < 0.3 * drawn.ntexdata
    for name in dir(drawn):
        value = getattr(drawn, name)
        if isinstance(value, np.ndarray) and name not in _PIXELS and name[0] != "_":
            np.testing.assert_array_equal(getattr(plain, name), value, err_msg=name)


def test_floor_textures_keep_their_size() -> None:
    """Floor textures keep their resolution; uniform ones shrink."""
    model = _model()
    flat = model.tex_type == mujoco.mjtTexture.mjTEXTURE_2D
    assert model.tex_width[flat].tolist() == [100]
    assert model.tex_width[~flat].tolist() == [50, 63]


def test_floors_are_quiet_and_lights_follow_high_above() -> None:
    """Tiles of two greys without mirror images, and a light above the largest body."""
    with gym.make("shapechanger/Humanoid-v1") as env:
        model: Any = env.unwrapped.model
    (floor,) = np.flatnonzero(model.tex_type == mujoco.mjtTexture.mjTEXTURE_2D)
    start = int(model.tex_adr[floor])
    tiles = model.tex_data[start : start + 100 * 100 * 3]
    assert 90 < tiles.min() < tiles.max() < 170
    assert not model.mat_reflectance.any()
    assert model.light_pos[0, 2] >= 4.0
    assert model.light_mode[0] == mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM
