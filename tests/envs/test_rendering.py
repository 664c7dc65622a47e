"""Frames and pictures: that there is something on them, and that they follow the body."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

from shapechanger.envs import CATALOGUE
from tests.drawing import run_python

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_SIZE = {"width": 120, "height": 90}


@pytest.fixture
def ant() -> Iterator[Any]:
    """An ant that draws frames."""
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **_SIZE) as env:
        env.reset(seed=0)
        yield env


def _hide(env: Any, *, but: str = "") -> None:
    """Make the body, but for one of its geoms, transparent, with nothing to be seen of it."""
    model = env.unwrapped.model
    for geom in np.flatnonzero(model.geom_bodyid > 0):
        model.geom_rgba[geom, 3] = float(model.geom(geom).name == but)


def _without_shadows(env: Any) -> None:
    """Let the body be seen in its own place only."""
    model = env.unwrapped.model
    model.light_castshadow[:] = 0
    model.mat_reflectance[:] = 0.0


def _differs(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Which pixels differ by more than rounding."""
    return np.any(np.abs(one.astype(int) - other.astype(int)) > 4, axis=2)


# Frames.


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_a_frame_shows_the_body(env_id: str) -> None:
    """It is of the size asked for, not of one colour, and changes when the body goes away."""
    # Gymnasium looks at these two from so far away that they are a few pixels.
    far = "Double" in env_id or "Walker2d" in env_id
    nearer = {"default_camera_config": {"distance": 2.0}} if far else {}
    with gym.make(env_id, render_mode="rgb_array", **nearer, **_SIZE) as env:
        env.reset(seed=0)
        frame = env.render()
        assert (frame.shape, frame.dtype) == ((90, 120, 3), np.uint8)
        assert frame.std() > 10.0
        np.testing.assert_array_equal(env.render(), frame)
        _hide(env)
        assert _differs(env.render(), frame).mean() > 0.01


def test_a_frame_shows_how_the_body_moves(ant: Any) -> None:
    """Frames of a step and of the next are not the same."""
    frame = ant.render()
    ant.step(np.array([1, -1, 1, -1, 1, -1, 1, -1], np.float32))
    assert _differs(ant.render(), frame).any()


def test_a_frame_shows_depths() -> None:
    """A depth for each pixel, nearer where the body is, with the colours if asked for."""
    with gym.make("shapechanger/Ant-v1", render_mode="depth_array", **_SIZE) as env:
        env.reset(seed=0)
        depth = env.render()
        assert (depth.shape, depth.dtype) == ((90, 120), np.float32)
        _hide(env)
        farther = env.render() - depth
        assert farther.min() >= 0.0
        assert (farther > 0.0).mean() > 0.01
    with gym.make("shapechanger/Ant-v1", render_mode="rgbd_tuple", **_SIZE) as env:
        env.reset(seed=0)
        frames: Any = env.render()
        colours, again = frames
        assert colours.shape == (90, 120, 3)
        np.testing.assert_array_equal(again, depth)


def test_envs_draw_side_by_side(ant: Any) -> None:
    """OpenGL draws for one at a time; another env, or a picture, must not leave black frames."""
    frame = ant.render()
    with gym.make("shapechanger/BigAnt-v1", render_mode="rgb_array", **_SIZE) as other:
        other.reset(seed=0)
        other_frame = other.render()
        assert _differs(other_frame, frame).any()
        for _ in range(2):
            np.testing.assert_array_equal(ant.render(), frame)
            np.testing.assert_array_equal(other.render(), other_frame)
        ant.unwrapped.picture(64, 48)
        np.testing.assert_array_equal(ant.render(), frame)
    del other
    gc.collect()
    np.testing.assert_array_equal(ant.render(), frame)


def test_an_env_that_is_dropped_leaves_the_others_their_pictures(ant: Any) -> None:
    """Not everybody closes what they made."""
    frame = ant.render()
    dropped = gym.make("shapechanger/BigAnt-v1", render_mode="rgb_array", **_SIZE)
    dropped.reset(seed=0)
    dropped.render()
    np.testing.assert_array_equal(ant.render(), frame)
    del dropped
    gc.collect()
    np.testing.assert_array_equal(ant.render(), frame)


def test_a_closed_env_can_draw_again(ant: Any) -> None:
    """Closing twice does no harm, and a frame after it is drawn anew."""
    frame = ant.render()
    ant.close()
    ant.close()
    np.testing.assert_array_equal(ant.render(), frame)


# The camera.


def _seen(env: Any) -> np.ndarray:
    """The pixels of a frame that show the body; it is gone afterwards."""
    _without_shadows(env)
    frame = env.render()
    _hide(env)
    return _differs(env.render(), frame)


@pytest.mark.parametrize("body", ["Ant", "BigAnt", "ExtendedAnt"])
def test_the_camera_follows_a_body_that_runs(body: str) -> None:
    """It is as large, and in the same place, thirty metres on; and no part is cut off."""
    seen = []
    for x, y in ((0.0, 0.0), (30.0, -20.0)):
        with gym.make("shapechanger/Ant-v1", body=body, render_mode="rgb_array", **_SIZE) as env:
            env.reset(seed=0)
            inner = env.unwrapped
            pose = inner.init_qpos.copy()
            pose[:2] = x, y
            inner.set_state(pose, inner.init_qvel)
            seen.append(_seen(env))
    here, there = seen
    assert here.mean() > 0.02
    assert (here != there).mean() < 0.2 * here.mean()
    border = np.concatenate((here[0], here[-1], here[:, 0], here[:, -1]))
    assert not border.any()


@pytest.mark.parametrize("name", ["HalfCheetah", "Hopper", "Walker2d", "Swimmer"])
def test_the_camera_follows_a_body_that_runs_in_a_plane(name: str) -> None:
    """Ten metres on it is still there, as large as before."""
    seen = []
    for x in (0.0, 10.0):
        with gym.make(f"shapechanger/{name}-v1", render_mode="rgb_array", **_SIZE) as env:
            env.reset(seed=0)
            inner = env.unwrapped
            pose = inner.init_qpos.copy()
            pose[0] = x
            inner.set_state(pose, inner.init_qvel)
            seen.append(_seen(env).mean())
    assert min(seen) > 0.01
    assert seen[1] == pytest.approx(seen[0], rel=0.2)


def test_a_camera_that_is_told_where_to_look_stays() -> None:
    """The world is looked at, and the body runs out of it."""
    camera = {"lookat": np.array([0.0, 0.0, 0.5]), "distance": 6.0, "elevation": -30.0}
    with gym.make(
        "shapechanger/Ant-v1", render_mode="rgb_array", default_camera_config=camera, **_SIZE
    ) as env:
        env.reset(seed=0)
        inner = env.unwrapped
        env.render()
        pose = inner.init_qpos.copy()
        pose[:2] = 30.0, -20.0
        inner.set_state(pose, inner.init_qvel)
        assert not _seen(env).any()
        np.testing.assert_array_equal(inner.mujoco_renderer.viewer.cam.lookat, camera["lookat"])


# Another body.


def test_frames_follow_the_body(ant: Any) -> None:
    """After a reset the new body is drawn, as by an env that was made with it."""
    before = ant.render()
    ant.reset(seed=0, options={"body": "BigAnt"})
    after = ant.render()
    assert after.shape == before.shape
    assert _differs(after, before).any()
    with gym.make("shapechanger/BigAnt-v1", render_mode="rgb_array", **_SIZE) as made:
        made.reset(seed=0)
        np.testing.assert_array_equal(made.render(), after)
    ant.reset(seed=0, options={"body": "Ant"})
    np.testing.assert_array_equal(ant.render(), before)


def test_the_camera_stays_as_it_was_asked_for() -> None:
    """Camera, size and options are those of the env, whichever body it has."""
    camera = {"distance": 9.0, "trackbodyid": 0, "elevation": -80.0}
    arguments = {
        "default_camera_config": camera,
        "max_geom": 500,
        "visual_options": {0: True},
        "width": 80,
        "height": 60,
    }
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **arguments) as env:
        frames = []
        for body in ("BigAnt", "Ant"):
            env.reset(seed=0, options={"body": body})
            frames.append(env.render())
            renderer = env.unwrapped.mujoco_renderer
            assert renderer.default_cam_config == camera
            assert renderer.max_geom == 500
            assert renderer.viewer.cam.distance == 9.0
            assert renderer.viewer.vopt.flags[0] == 1
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **arguments) as env:
        env.reset(seed=0)
        np.testing.assert_array_equal(env.render(), frames[1])
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **_SIZE, camera_id=0) as env:
        env.reset(seed=0, options={"body": "BigAnt"})
        assert env.unwrapped.mujoco_renderer.camera_id == 0


def test_the_old_body_is_not_kept(ant: Any) -> None:
    """A training with a new body each episode must not grow: model, viewer and context go."""
    ant.render()
    renderer = ant.unwrapped.mujoco_renderer
    context = renderer.viewer.opengl_context
    old = [weakref.ref(renderer), weakref.ref(renderer.viewer)]
    del renderer
    ant.reset(options={"body": "BigAnt"})
    assert context._context is None
    gc.collect()
    assert [ref() for ref in old] == [None, None]
    ant.render()
    assert len(ant.unwrapped.mujoco_renderer._viewers) == 1


# Pictures.


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_a_picture_holds_the_whole_body(env_id: str) -> None:
    """At its own reach: nothing is cut off at the border, and it is not lost in the middle."""
    with gym.make(env_id) as made:
        env: Any = made.unwrapped
        _without_shadows(env)
        picture = env.picture(**_SIZE)
        assert (picture.shape, picture.dtype) == ((90, 120, 3), np.uint8)
        assert picture.std() > 10.0
        reach = env.reach
        _hide(env)
        seen = _differs(env.picture(**_SIZE, reach=reach), picture)
    border = np.concatenate((seen[0], seen[-1], seen[:, 0], seen[:, -1]))
    assert not border.any()
    # Some floors reflect the body, and darkly.
    assert picture[seen].mean() > 70.0
    rows = np.flatnonzero(seen.any(axis=1))
    columns = np.flatnonzero(seen.any(axis=0))
    assert max(np.ptp(rows) / 90, np.ptp(columns) / 120) > 0.25


def _torso_pixels(env_id: str, reach: float) -> int:
    """How many pixels the torso takes; it is the same ball on each ant."""
    with gym.make(env_id) as made:
        env: Any = made.unwrapped
        _without_shadows(env)
        _hide(env, but="torso_geom")
        with_torso = env.picture(width=320, height=240, reach=reach)
        _hide(env)
        without = env.picture(width=320, height=240, reach=reach)
    return int(_differs(with_torso, without).sum())


def test_bodies_are_drawn_to_one_scale() -> None:
    """With one reach for both, what is as large is drawn as large."""
    with gym.make("shapechanger/Ant-v1") as one, gym.make("shapechanger/BigAnt-v1") as other:
        small, large = one.unwrapped.reach, other.unwrapped.reach
    assert large > 1.4 * small
    reference = _torso_pixels("shapechanger/Ant-v1", large)
    # The torso of the ant is a little nearer to the camera's middle than that of its big brother.
    assert _torso_pixels("shapechanger/BigAnt-v1", large) == pytest.approx(reference, rel=0.1)
    assert _torso_pixels("shapechanger/Ant-v1", small) > 1.4 * reference


def test_a_picture_changes_nothing(ant: Any) -> None:
    """Neither the state nor the model, nor how the env draws."""
    env = ant.unwrapped
    state, headlight = env.state_vector(), env.model.vis.headlight.ambient.copy()
    width = env.model.vis.global_.offwidth
    env.picture(width=1000, height=20)
    np.testing.assert_array_equal(env.state_vector(), state)
    np.testing.assert_array_equal(env.model.vis.headlight.ambient, headlight)
    assert env.model.vis.global_.offwidth == width


def test_a_picture_shows_the_start_and_not_the_state(ant: Any) -> None:
    """So that two of them compare bodies, not poses."""
    picture = ant.unwrapped.picture(**_SIZE)
    for _ in range(5):
        ant.step(np.ones(8, np.float32))
    np.testing.assert_array_equal(ant.unwrapped.picture(**_SIZE), picture)
    ant.reset(options={"body": "AmputatedAnt"})
    assert _differs(ant.unwrapped.picture(**_SIZE), picture).any()


# Windows.

_WINDOW = """
import glfw
import gymnasium as gym
import mujoco
import numpy as np
import shapechanger

def seen(env):
    viewer = env.unwrapped.mujoco_renderer.viewer
    pixels = np.zeros((60, 80, 3), np.uint8)
    viewer.make_context_current()
    mujoco.mjr_readPixels(pixels, None, mujoco.MjrRect(0, 0, 80, 60), viewer.con)
    return pixels

with gym.make("shapechanger/Ant-v1", render_mode="human", width=80, height=60) as env:
    env.reset(seed=0)
    viewer = env.unwrapped.mujoco_renderer.viewer
    print(glfw.get_window_size(viewer.window))
    for _ in range(2):
        env.step(env.action_space.sample())
    print(seen(env).std() > 10.0)
    env.unwrapped.picture(64, 48)
    env.step(env.action_space.sample())
    env.reset(seed=0, options={"body": "BigAnt"})
    print(env.unwrapped.mujoco_renderer.viewer is not viewer)
    del viewer
    env.step(env.action_space.sample())
    print(seen(env).std() > 10.0)
env.close()
print("closed")
"""


def test_a_window_opens(display: str) -> None:
    """With the body in it, through steps, pictures and a new body."""
    run = run_python(_WINDOW, DISPLAY=display)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == ["(80, 60)", "True", "True", "True", "closed"]


def test_gymnasium_records_videos(tmp_path: Path) -> None:
    """`RecordVideo` has its encoder from the extra `sim`."""
    env = RecordVideo(
        gym.make("shapechanger/InvertedPendulum-v1", render_mode="rgb_array"),
        str(tmp_path / "videos"),
        disable_logger=True,
    )
    env.reset(seed=0)
    env.step(np.zeros(1, np.float32))
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert video.stat().st_size > 1000
