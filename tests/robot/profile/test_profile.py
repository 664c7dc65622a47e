"""Values that guard, daemon and workstation read from a profile, and the lines of its keys."""

import datetime
import math
import tomllib
from typing import Any

import pytest
from gpiozero.pins.data import PLUS_J8
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.contract.plan import ActionPlan, LimitPlan, StopPlan
from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.drivers.pins import BCM_OF_BOARD
from shapechanger.robot.profile import load_profile, shipped_profiles
from shapechanger.robot.profile.toml import Place, line_of
from tests.robot.profile.texts import EVERYTHING, changed, read


def test_everything_is_read() -> None:
    profile = read()
    assert (profile.name, profile.body, profile.control_hz) == ("rover", "car", 25.0)
    assert profile.calibrated == datetime.date(2026, 11, 3)
    assert profile.actions == (
        ActionPlan("steering", levels="three"),
        ActionPlan("throttle", low=-0.5, propels=True, slew_per_s=2.0),
        ActionPlan("arm", rest=0.25, unit="deg", gain=90.0),
    )
    assert profile.camera == CameraPlan(
        "v4l2", (128, 128), flip=True, settings={"device": "/dev/video0"}
    )
    assert profile.limits == LimitPlan(
        deadline_ms=200,
        camera_stale_ms=500,
        stop_distance_m=0.3,
        low_battery_v=6.6,
        high_temperature_c=80.0,
    )
    assert (profile.max_observation_age_ms, profile.arming) == (400, "anyone")
    assert (profile.enable_pin, profile.enable_hold_ms, profile.stop_pin) == (19, 50, 21)
    assert profile.stop == StopPlan(then="release")
    assert profile.reward == {
        "velocity": 2.0,
        "collision": -10.0,
        "stall": -1.0,
        "collision_ends_episode": 0.0,
    }
    # Actions that a step does not name are at rest.
    assert profile.reset == (((0.0, -0.4, 0.25), 1.0), ((0.0, 0.0, 0.5), 0.5))


def test_a_profile_may_state_how_the_robot_turns() -> None:
    """Profiles state the turn in degrees, programs get rad; one of the two numbers suffices."""
    assert read().turning is None
    stated = read(changed("control_hz = 25", "control_hz = 25\nturn_deg_per_m = 90"))
    assert stated.turning == pytest.approx((0.5 * math.pi, 0.0))


def test_outputs_and_sensors_have_all_settings_of_their_drivers() -> None:
    """Settings have the default of each missing key, and pins as BCM numbers."""
    settings = {output.name: output.settings for output in read().outputs}
    assert settings["drive"] == {
        "forward": 22, "backward": 27, "enable": 26, "pwm_hz": 50, "start": 0.0, "full": 1.0,
    }  # fmt: skip
    assert settings["steer"] == {
        "over": "pca9685", "hz": 50, "bus": 1, "address": 0x40, "channel": 0, "output_enable": 25,
        "left_us": 2000, "centre_us": 1500, "right_us": 1000, "travel_deg_per_s": math.inf,
    }  # fmt: skip
    assert settings["pump"] == {
        "over": "sysfs", "hz": 50, "chip": 0, "channel": 0,
        "backward_us": 1000, "neutral_us": 1500, "forward_us": 2000,
        "arm_s": 2.5, "reverse": "direct", "brake_ms": 200,
    }  # fmt: skip
    sensors = {sensor.name: (sensor.measures, sensor.settings) for sensor in read().sensors}
    assert sensors["bumper"] == ("bump", {"pins": [12, 13], "pull": "up"})
    assert sensors["wheel"][1] == {"a": 16, "b": 20, "counts_per_turn": 20.0, "wheel_m": 0.21}


def test_layouts_name_every_number() -> None:
    """Gains are in SI units, and ranges ignore caps."""
    profile = read()
    assert profile.action_layout() == Layout(
        (
            Feature("steering", "1", -1.0, 1.0, Element("actuator", "steering")),
            Feature("throttle", "1", -1.0, 1.0, Element("actuator", "throttle")),
            Feature(
                "arm", "1", -1.0, 1.0, Element("actuator", "arm"),
                gain=math.radians(90.0), gain_unit="rad",
            ),
        )
    )  # fmt: skip
    assert [str(feature) for feature in profile.state_layout()] == [
        "speed [m/s]",
        "distance [m]",
        "bump [1]",
        "stall [1]",
        "collision [1]",
        "yaw_rate [rad/s]",
        "acceleration_x [m/s²]",
        "acceleration_y [m/s²]",
        "battery [V]",
        "temperature [°C]",
        "steering/applied [1]",
        "throttle/applied [1]",
        "arm/applied [1]",
    ]
    assert profile.state_layout()["speed"].element == Element("sensor", "wheel")


def test_a_speed_may_come_from_the_profile() -> None:
    """Without an encoder, the state has a speed if the throttle has a gain in m/s."""
    car = shipped_profiles()["car"].read_text()
    assert "speed" not in load_profile(shipped_profiles()["car"]).state_layout()
    profile = read(changed("propels = true", 'propels = true\nunit = "m/s"\ngain = 1.5', car))
    assert profile.state_layout()["speed"].element == Element("actuator", "throttle")
    assert profile.action_layout()["throttle"].gain_unit == "m/s"


def test_a_minimal_profile() -> None:
    text = EVERYTHING.split("[action.steering]", maxsplit=1)[0]
    profile = read(
        text + '[action.turn]\n[output.turn]\ndriver = "hbridge"\nforward = 4\nbackward = 5\n'
        "mix = { turn = 1.0 }\n"
    )
    assert profile.camera is profile.enable_pin is profile.stop_pin is None
    assert profile.limits == LimitPlan()
    assert profile.arming == "person"
    assert profile.guard_plan().enable_pin is None
    assert profile.reset == ()


def test_pin_minus_1_means_unconnected() -> None:
    without, with_none = (read(changed("enable = 26\n", new)) for new in ("", "enable = -1\n"))
    assert without == with_none


def test_the_header_matches_gpiozero() -> None:
    pins: dict[int, dict[str, str]] = PLUS_J8[2]
    named = {n: int(p["gpio"].removeprefix("GPIO")) for n, p in pins.items() if "gpio" in p}
    assert named == BCM_OF_BOARD


VALUES = st.sampled_from(
    ["1", '"a # b = c"', "'[x]'", "[1, [2], 3]", "{ p = 1, q = '}' }", '[\n"]",\n# ]\n1\n]', "1.5"]
)
NAMES = st.sampled_from(["a", "b", "c-d", '"e f"', "'g.h'"])


@given(
    tables=st.dictionaries(
        NAMES, st.dictionaries(NAMES, VALUES, max_size=4), min_size=1, max_size=4
    )
)
def test_every_key_is_found_on_its_line(tables: dict[str, dict[str, str]]) -> None:
    text = "".join(
        f"[{table}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) + "\n"
        for table, keys in tables.items()
    )
    data: dict[str, Any] = tomllib.loads(text)
    lines = text.split("\n")
    places: list[Place] = [(table,) for table in data]
    places += [(table, key) for table, keys in data.items() for key in keys]
    for place in places:
        found = lines[line_of(text, place) - 1]
        assert found.lstrip("[\"'").startswith(str(place[-1]))
