"""Frames and pictures of a finger: what is on them, and that drawing moves nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.bodies.finger.anatomy import JOINT_REST
from shapechanger.bodies.finger.looks import TENDON_COLOURS

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_SIZE = {"width": 160, "height": 120}


@pytest.fixture
def finger() -> Iterator[Any]:
    """A finger that draws frames."""
    with gym.make("shapechanger/Finger-v1", render_mode="rgb_array", **_SIZE) as env:
        env.reset(seed=0, options={"posture": JOINT_REST.tolist()})
        yield env


def _differs(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Which pixels differ by more than rounding."""
    return np.any(np.abs(one.astype(int) - other.astype(int)) > 4, axis=2)


def test_a_frame_is_bright_and_shows_the_finger(finger: Any) -> None:
    """Of the size asked for, light at its border, and the finger takes a part of it."""
    frame = finger.render()
    assert (frame.shape, frame.dtype) == ((120, 160, 3), np.uint8)
    border = np.concatenate([frame[0], frame[-1], frame[:, 0], frame[:, -1]])
    assert border.min() > 190
    assert 0.03 < (frame.min(axis=2) < 180).mean() < 0.4
    np.testing.assert_array_equal(finger.render(), frame)


def test_a_frame_shows_how_the_finger_moves(finger: Any) -> None:
    """And where it should be."""
    frame = finger.render()
    finger.step(np.array([1, 1, -1, -1, -1, -1, -1], np.float32))
    finger.step(np.array([1, 1, -1, -1, -1, -1, -1], np.float32))
    assert _differs(finger.render(), frame).mean() > 0.005
    frames = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        options = {"posture": JOINT_REST.tolist(), "target": target}
        finger.reset(seed=0, options=options)
        frames.append(finger.render())
    assert 0.001 < _differs(*frames).mean() < 0.1


def test_a_target_that_is_reached_is_seen(finger: Any) -> None:
    """It is as large as what counts as reached, and the fingertip does not hide it."""
    rest = JOINT_REST.tolist()
    finger.reset(seed=0, options={"posture": rest, "target": rest})
    reached = finger.render().astype(int)
    green = (reached[:, :, 1] > reached[:, :, 0] + 30) & (reached[:, :, 1] > reached[:, :, 2] + 15)
    finger.reset(seed=0, options={"posture": rest, "target": (0.0, 0.0, -0.5)})
    without = finger.render().astype(int)
    still_green = (without[:, :, 1] > without[:, :, 0] + 30) & (
        without[:, :, 1] > without[:, :, 2] + 15
    )
    assert green.sum() > still_green.sum() + 20


def test_each_tendon_is_seen(finger: Any) -> None:
    """From this side or the other: taking it away changes a frame."""
    finger.render()
    env = finger.unwrapped
    model = env._figure.model
    frame = finger.render()
    hidden = []
    for name in TENDON_COLOURS:
        course = model.tendon(f"{name}/course").id
        model.tendon_rgba[course, 3] = 0.0
        if _differs(finger.render(), frame).sum() < 5:
            hidden.append(name)
        model.tendon_rgba[course, 3] = 1.0
    assert set(hidden) <= {"PI"}  # On the other side of the finger.


def test_tension_makes_a_tendon_thick(finger: Any) -> None:
    """At the same posture, a tendon that pulls takes more of the picture."""
    env = finger.unwrapped
    frames = []
    for tension in (0.0, 1.0):
        env.plant.data.actuator_force[:] = -tension * np.array(env.parameters.most_tension)
        frames.append(finger.render())
    assert _differs(*frames).mean() > 0.005


def test_drawing_moves_nothing() -> None:
    """An episode that is drawn is bit by bit that which is not."""
    found = []
    for mode in (None, "rgb_array"):
        with gym.make("shapechanger/Finger-v1", render_mode=mode, **_SIZE) as env:
            env.reset(seed=3)
            rng = np.random.default_rng(0)
            seen = []
            for _ in range(5):
                seen.append(env.step(rng.uniform(-1, 1, 7).astype(np.float32))[0])
                env.render()
                if mode:
                    env.unwrapped.picture(64, 48)
            found.append(np.array(seen))
    np.testing.assert_array_equal(*found)


def test_a_picture_holds_the_whole_finger(finger: Any) -> None:
    """Hand and fingertip, and no target: it compares bodies."""
    env = finger.unwrapped
    rest = JOINT_REST.tolist()
    pictures = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        finger.reset(seed=0, options={"posture": rest, "target": target})
        pictures.append(env.picture(**_SIZE))
    np.testing.assert_array_equal(*pictures)
    dark = pictures[0].min(axis=2) < 190
    assert dark.mean() > 0.01
    assert not np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]]).any()
    columns = np.flatnonzero(dark.any(axis=0))
    assert np.ptp(columns) > 0.25 * 160


def test_another_finger_is_drawn_in_the_same_window() -> None:
    """With another finger at each reset the renderer stays, and so would its window."""
    arguments = {"render_mode": "rgb_array", "gap": "wide", **_SIZE}
    with gym.make("shapechanger/Finger-v1", **arguments) as env:
        env.reset(seed=0)
        env.render()
        renderer = env.unwrapped._renderer
        env.reset(seed=1)
        env.render()
        assert env.unwrapped._renderer is renderer


def test_depths_are_those_of_the_finger() -> None:
    """Nearer where it is than behind it."""
    with gym.make("shapechanger/FingerTrack-v1", render_mode="depth_array", **_SIZE) as env:
        env.reset(seed=0)
        depth = env.render()
        assert (depth.shape, depth.dtype) == ((120, 160), np.float32)
        # As OpenGL has them: 1 is infinitely far, and 0.995 some 30 cm.
        assert 0.02 < (depth < 0.995).mean() < 0.5
