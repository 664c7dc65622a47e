"""Frames and images of the MuJoCo envs."""

from __future__ import annotations

import gc
import pickle
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

from tests.drawing import run_python

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_SIZE = {"width": 120, "height": 90}
# Bodies that differ in size or in their surroundings.
_SHAPES = [
    f"shapechanger/{name}-v1"
    for name in ("Ant", "ExtendedAnt", "Humanoid", "InvertedDoublePendulum", "Swimmer", "Walker2d")
]


@pytest.fixture
def ant() -> Iterator[Any]:
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **_SIZE) as env:
        env.reset(seed=0)
        yield env


def _hide(env: Any, *, but: str = "") -> None:
    model = env.unwrapped.model
    for geom in np.flatnonzero(model.geom_bodyid > 0):
        model.geom_rgba[geom, 3] = float(model.geom(geom).name == but)


def _without_shadows(env: Any) -> None:
    model = env.unwrapped.model
    model.light_castshadow[:] = 0
    model.mat_reflectance[:] = 0.0


def _differs(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.any(np.abs(one.astype(int) - other.astype(int)) > 4, axis=2)


# Frames.


@pytest.mark.parametrize("env_id", _SHAPES)
def test_a_frame_shows_the_body(env_id: str) -> None:
    """The frame has the requested size and changes when the body is hidden."""
    # Gymnasium's cameras show these two as a few pixels only.
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


def test_depth_frames() -> None:
    """Depth is smaller at the body; `rgbd_tuple` has both arrays."""
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


def test_envs_render_in_turn(ant: Any) -> None:
    """Switching between envs and images gives no black frames."""
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


def test_a_closed_env_can_render_again(ant: Any) -> None:
    """Closing is idempotent, and rendering afterwards works."""
    frame = ant.render()
    ant.close()
    ant.close()
    np.testing.assert_array_equal(ant.render(), frame)


# The camera.


def _seen(env: Any) -> np.ndarray:
    """Return the pixels that show the body, and hide the body."""
    _without_shadows(env)
    frame = env.render()
    _hide(env)
    return _differs(env.render(), frame)


@pytest.mark.parametrize(
    ("name", "moved"),
    [
        *((name, (30.0, -20.0)) for name in ("Ant", "ExtendedAnt")),
        *((name, (10.0,)) for name in ("Hopper", "Swimmer")),
    ],
)
def test_the_camera_follows_the_body(name: str, moved: tuple[float, ...]) -> None:
    """A body that has moved far away has the same size in the frame, and an ant the same place."""
    seen = []
    for place in ((0.0,) * len(moved), moved):
        with gym.make(f"shapechanger/{name}-v1", render_mode="rgb_array", **_SIZE) as env:
            env.reset(seed=0)
            inner = env.unwrapped
            pose = inner.init_qpos.copy()
            pose[: len(moved)] = place
            inner.set_state(pose, inner.init_qvel)
            seen.append(_seen(env))
    here, there = seen
    assert here.mean() > 0.01
    assert there.mean() == pytest.approx(here.mean(), rel=0.2)
    if "Ant" in name:
        assert (here != there).mean() < 0.2 * here.mean()
        border = np.concatenate((here[0], here[-1], here[:, 0], here[:, -1]))
        assert not border.any()


def test_a_given_lookat_is_fixed() -> None:
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


def test_the_camera_settings_are_kept() -> None:
    camera = {"distance": 9.0, "trackbodyid": 0, "elevation": -80.0}
    arguments = {"default_camera_config": camera, "max_geom": 500, "visual_options": {0: True}}
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **arguments, **_SIZE) as env:
        for body in ("BigAnt", "Ant"):
            env.reset(seed=0, options={"body": body})
            env.render()
            renderer = env.unwrapped.mujoco_renderer
            assert renderer.default_cam_config == camera
            assert renderer.max_geom == 500
            assert renderer.viewer.cam.distance == 9.0
            assert renderer.viewer.vopt.flags[0] == 1
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **_SIZE, camera_id=0) as env:
        env.reset(seed=0, options={"body": "BigAnt"})
        assert env.unwrapped.mujoco_renderer.camera_id == 0


def test_the_old_renderer_is_freed(ant: Any) -> None:
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


# Images.


@pytest.mark.parametrize("env_id", _SHAPES)
def test_a_picture_shows_the_whole_body(env_id: str) -> None:
    """At its own reach, the body is large in the image and is not cropped."""
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
    # The pixels of the body are not dark.
    assert picture[seen].mean() > 70.0
    rows = np.flatnonzero(seen.any(axis=1))
    columns = np.flatnonzero(seen.any(axis=0))
    assert max(np.ptp(rows) / 90, np.ptp(columns) / 120) > 0.25


def test_a_reach_sets_the_scale(ant: Any) -> None:
    """At twice the reach, the body covers about a quarter of the pixels."""
    env, shown = ant.unwrapped, []
    _without_shadows(env)
    reaches = 1.2 * env.reach, 2.4 * env.reach
    pictures = [env.picture(width=320, height=240, reach=reach) for reach in reaches]
    _hide(env)
    for reach, picture in zip(reaches, pictures, strict=True):
        shown.append(_differs(env.picture(width=320, height=240, reach=reach), picture).sum())
    assert shown[1] == pytest.approx(shown[0] / 4.0, rel=0.15)


def test_a_picture_shows_the_start_and_changes_nothing(ant: Any) -> None:
    """Pictures show the start pose, so that they compare bodies; state and model stay."""
    env = ant.unwrapped
    picture = env.picture(**_SIZE)
    for _ in range(5):
        ant.step(np.ones(8, np.float32))
    state, width = env.state_vector(), env.model.vis.global_.offwidth
    np.testing.assert_array_equal(env.picture(**_SIZE), picture)
    env.picture(width=1000, height=20)
    np.testing.assert_array_equal(env.state_vector(), state)
    assert env.model.vis.global_.offwidth == width
    ant.reset(options={"body": "AmputatedAnt"})
    assert _differs(env.picture(**_SIZE), picture).any()


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
    """Human rendering works through steps, images and a new body."""
    run = run_python(_WINDOW, DISPLAY=display)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines() == ["(80, 60)", "True", "True", "True", "closed"]


# Compiling MoviePy 1 for the first time warns, before Python 3.12 of a deprecation.
@pytest.mark.filterwarnings("ignore::SyntaxWarning", "ignore:invalid escape:DeprecationWarning")
def test_gymnasium_records_videos(tmp_path: Path) -> None:
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


@pytest.mark.parametrize(
    "env_id", ["InvertedPendulum", "BigInvertedPendulum", "InvertedDoublePendulum"]
)
def test_a_pendulum_is_seen_whole_on_a_light_background(env_id: str) -> None:
    """The background is light although the model has no sky, and the pole is in view."""
    env = gym.make(f"shapechanger/{env_id}-v1", render_mode="rgb_array")
    env.reset(seed=0)
    frame: Any = env.render()
    env.close()
    assert frame[0].min() > 200
    body = frame[frame.min(axis=2) < 200]
    assert body.max(axis=1).mean() > 120.0


@pytest.mark.parametrize("shadows", [False, True])
def test_floors_are_grey_and_shadows_are_not_black(shadows: bool) -> None:
    """In Gymnasium's frames with shadows, floors are green and shadows black; here they are not."""
    env = gym.make("shapechanger/Ant-v1", render_mode="rgb_array", shadows=shadows, **_SIZE)
    env.reset(seed=0)
    frame: Any = env.render()
    env.close()
    floor = frame[:, : _SIZE["width"] // 8].astype(int)  # Left of the body.
    assert np.abs(floor[..., 1] - (floor[..., 0] + floor[..., 2]) / 2).max() < 8
    assert frame.max(axis=2).min() > 40


def test_floors_do_not_end(ant: Any) -> None:
    """An ant that has walked for a kilometre is on tiles; the floor for contacts does not move."""
    data = ant.unwrapped.data
    near = ant.render().astype(int)
    repeats = 80.0 / 60.0  # Width of the floor, m, divided by the number of repeats of its tiles.
    data.qpos[0] += 750 * repeats
    mujoco.mj_forward(ant.unwrapped.model, data)
    floor = ant.unwrapped.model.geom("floor").id
    before = data.geom_xpos[floor].copy()
    far = ant.render().astype(int)
    np.testing.assert_array_equal(data.geom_xpos[floor], before)
    assert np.abs(near - far).mean() < 3.0


# Textures.

_PIXELS = ("tex_data", "tex_adr", "tex_width", "tex_height")


def _textured(**arguments: Any) -> Any:
    with gym.make("shapechanger/Ant-v1", **arguments) as env:
        return env.unwrapped.model


def test_only_textures_differ_without_rendering() -> None:
    plain, drawn = _textured(), _textured(render_mode="rgb_array")
    assert plain.ntexdata < 0.3 * drawn.ntexdata
    flat = plain.tex_type == mujoco.mjtTexture.mjTEXTURE_2D  # Floors are unchanged.
    assert plain.tex_width[flat].tolist() == [100]
    for name in dir(drawn):
        value = getattr(drawn, name)
        if isinstance(value, np.ndarray) and name not in _PIXELS and name[0] != "_":
            np.testing.assert_array_equal(getattr(plain, name), value, err_msg=name)


# Shadows.


@pytest.mark.parametrize(
    ("size", "arguments", "shadows"),
    [(256, {}, False), (257, {}, True), (64, {"shadows": True}, True)],
)
def test_small_frames_have_no_shadows(size: int, arguments: dict[str, Any], shadows: bool) -> None:
    """By default, frames of up to 256 x 256 pixels have no shadows; copies render the same."""
    more = {"render_mode": "rgb_array", "width": size, "height": size, **arguments}
    with gym.make("shapechanger/Ant-v1", **more) as env:
        quality = env.unwrapped.model.vis.quality
        before = quality.offsamples, quality.shadowsize
        env.reset(seed=0)
        frame = env.render()
        assert (quality.offsamples, quality.shadowsize) == before
        viewer = env.unwrapped.mujoco_renderer.viewer
        assert bool(viewer.scn.flags[mujoco.mjtRndFlag.mjRND_SHADOW]) is shadows
        assert bool(viewer.con.offSamples) is shadows
        copies = [pickle.loads(pickle.dumps(env)), gym.make(env.spec)]
    for again in copies:
        again.reset(seed=0)
        np.testing.assert_array_equal(again.render(), frame)
        again.close()


def test_a_frame_shows_edited_colours() -> None:
    size = {"width": 64, "height": 64}
    with gym.make("shapechanger/Ant-v1", render_mode="rgb_array", **size) as env:
        env.reset(seed=0)
        before = env.render()
        env.unwrapped.model.mat_rgba[:] = env.unwrapped.model.geom_rgba[:] = (1.0, 0.0, 0.0, 1.0)
        assert (env.render() != before).any()
