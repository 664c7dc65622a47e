"""Default worlds of served twins."""

from pathlib import Path

import numpy as np
import pytest

from shapechanger.cli.robot.serve import place_of
from shapechanger.errors import ProfileError, RobotError
from shapechanger.finger.gap import GAPS
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.twin import finger_place
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile
from shapechanger.robot.twin.start import Place
from shapechanger.vehicles.twin import course_place
from tests.robots import changed, write_profile

pytestmark = pytest.mark.realtime


def _shipped(name: str) -> Profile:
    return load_profile(find_profile(name))


@pytest.mark.parametrize(
    ("name", "place"),
    [
        ("lab-car", course_place("corridor", "car")),
        ("lab-tank", course_place("corridor", "tank")),
        ("lab-truck", course_place("yard", "truck")),
        ("lab-boat", course_place("harbour", "boat")),
        ("cat", Place()),
        ("finger", finger_place(NOMINAL)),
        ("finger-pwm", Place()),
    ],
)
def test_the_default_place(name: str, place: Place) -> None:
    assert place_of(_shipped(name), "", ()) == place


def test_the_finger_of_a_gap_is_the_finger_of_the_env() -> None:
    drawn = place_of(_shipped("finger"), "", (), "real-like", 3)
    assert drawn == finger_place(GAPS["real-like"].draw(np.random.default_rng(3)))
    with pytest.raises(RobotError, match="lab-car has no servos for the tendons FDP"):
        place_of(_shipped("lab-car"), "", (), "real-like")


def test_a_body_with_other_parts_than_its_vehicle_is_in_the_room(tmp_path: Path) -> None:
    text = changed('part = "steering"', 'part = "rudder"')
    odd = write_profile(tmp_path, text)
    assert place_of(odd, "", ()) == Place()
    with pytest.raises(ProfileError, match="a car is driven by"):
        place_of(odd, "corridor", ())
