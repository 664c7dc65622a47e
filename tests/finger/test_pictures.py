"""Frames and images of a finger."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.visuals import TENDON_COLOURS, tendon_legend

pytestmark = [pytest.mark.gl, pytest.mark.usefixtures("gl")]

_SIZE = {"width": 160, "height": 120}


@pytest.fixture
def finger() -> Iterator[Any]:
    """A finger env that renders frames."""
    with gym.make("shapechanger/Finger-v1", render_mode="rgb_array", **_SIZE) as env:
        env.reset(seed=0, options={"posture": JOINT_REST.tolist()})
        yield env


def _differs(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the pixels that differ by more than rounding."""
    return np.any(np.abs(one.astype(int) - other.astype(int)) > 4, axis=2)


def test_a_frame_shows_posture_and_target_of_the_finger(finger: Any) -> None:
    """Frames have the requested size, a light border, and a dark finger."""
    frame = finger.render()
    assert (frame.shape, frame.dtype) == ((120, 160, 3), np.uint8)
    border = np.concatenate([frame[0], frame[-1], frame[:, 0], frame[:, -1]])
    assert border.min() > 190
    assert 0.03 < (frame.min(axis=2) < 180).mean() < 0.4
    np.testing.assert_array_equal(finger.render(), frame)
    for _ in range(2):
        finger.step(np.array([1, 1, -1, -1, -1, -1, -1], np.float32))
    assert _differs(finger.render(), frame).mean() > 0.005
    frames = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        finger.reset(seed=0, options={"posture": JOINT_REST.tolist(), "target": target})
        frames.append(finger.render())
    assert 0.001 < _differs(*frames).mean() < 0.1


def test_rendering_does_not_change_the_episode() -> None:
    """Observations with and without rendering are equal."""
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


def test_a_picture_shows_the_whole_finger_and_no_target(finger: Any) -> None:
    pictures = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        finger.reset(seed=0, options={"posture": JOINT_REST.tolist(), "target": target})
        pictures.append(finger.unwrapped.picture(**_SIZE))
    np.testing.assert_array_equal(*pictures)
    dark = pictures[0].min(axis=2) < 190
    assert dark.mean() > 0.01
    assert not np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]]).any()
    assert np.ptp(np.flatnonzero(dark.any(axis=0))) > 0.25 * 160


def test_the_legend_shows_tensions() -> None:
    """Bars grow with the tension, in the colours of the tendons; small frames have none."""
    frame = np.full((360, 480, 3), 230, np.uint8)
    slack, taut = (tendon_legend(frame, np.full(7, pulled)) for pulled in (0.0, 1.0))
    assert slack.shape == frame.shape
    for colour in TENDON_COLOURS.values():
        paint = np.round(255 * np.array(colour))
        drawn = [int((one == paint).all(axis=2).sum()) for one in (slack, taut)]
        assert drawn[1] > 20 * drawn[0]
        assert drawn[1] > 200
    assert (taut[45:] == 230).all()  # The finger is below it.
    assert (frame == 230).all()
    small = frame[:120, :160]
    assert tendon_legend(small, np.ones(7)) is small
