"""Images and observations decoded from messages of a robot."""

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from shapechanger.robot.client.connection import Received
from shapechanger.robot.client.observations import RobotSpaces, resize_picture
from tests.robot.client.robot import Robot, observation, picture

sides = st.integers(1, 12)


@given(width=sides, height=sides, wide=sides, high=sides, level=st.integers(0, 255))
def test_resizing_keeps_a_uniform_colour(
    width: int, height: int, wide: int, high: int, level: int
) -> None:
    small = resize_picture(np.full((height, width, 3), level, np.uint8), (wide, high))
    assert small.shape == (high, wide, 3)
    assert small.dtype == np.uint8
    assert (small == level).all()


@given(data=st.data(), wide=sides, high=sides, by=st.integers(1, 4))
def test_shrinking_by_a_whole_number_keeps_the_mean(
    data: st.DataObject, wide: int, high: int, by: int
) -> None:
    seed = data.draw(st.integers(0, 2**32 - 1))
    whole = np.random.default_rng(seed).integers(0, 256, (by * high, by * wide, 3), np.uint8)
    assert abs(float(resize_picture(whole, (wide, high)).mean()) - float(whole.mean())) <= 0.5


def spaces() -> RobotSpaces:
    welcome = Robot(actions=(), state=(), image_size=(16, 12))._welcome()
    return RobotSpaces(welcome, (16, 12), image=True, state=False)


def seen(frame_seq: int, jpeg: bytes | None) -> Received:
    message = observation(seq=frame_seq, frame_seq=frame_seq, frame=jpeg)
    return Received(message, 0.0, jpeg)


def test_a_frame_is_rgb_and_not_mirrored() -> None:
    shown = spaces().view(seen(1, picture((160, 120), number=10))).observation
    assert shown.shape == (12, 16, 3)
    assert shown.dtype == np.uint8
    assert abs(int(shown[..., 0].mean()) - 80) < 3
    assert shown[:, 0, 1].mean() < 20
    assert shown[:, -1, 1].mean() > 235


def _oversized() -> bytes:
    """A few bytes that claim an image of 1.2 GB."""
    whole = bytearray(picture((16, 16), 1))
    frame = whole.index(b"\xff\xc0")
    whole[frame + 5 : frame + 9] = (20_000).to_bytes(2, "big") * 2
    return bytes(whole)


@given(data=st.binary(max_size=200))
@example(data=picture((160, 120), 1)[:1000])
@example(data=_oversized())
def test_an_invalid_frame_shows_nothing(data: bytes) -> None:
    assert not spaces().shows(seen(1, data))


def test_a_restarted_robot_shows_its_new_frame() -> None:
    robot = spaces()
    before = robot.view(seen(1, picture((16, 12), 1)))
    robot.reconnect()
    after = robot.view(seen(1, picture((16, 12), 20)))
    assert after.fresh
    assert (after.observation != before.observation).any()
