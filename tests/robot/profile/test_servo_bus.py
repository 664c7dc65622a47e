"""The servo bus in a profile."""

from __future__ import annotations

import json

import pytest

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.profile import load_profile, shipped_profiles
from tests.robot.profile.texts import changed, finger_text, read

_TEXT = shipped_profiles()["finger"].read_text()
_SENSOR = _TEXT[_TEXT.index("[sensor.tendons]") : _TEXT.index("[sensor.joints]")]
_BUS = _TEXT[_TEXT.index("[servo_bus]") : _TEXT.index("[action.FDP]")]


def test_outputs_include_the_bus_and_the_sensor_its_tendons() -> None:
    plan = load_profile(shipped_profiles()["finger"]).guard_plan()
    assert {str(output.settings["device"]) for output in plan.outputs} == {"/dev/ttyUSB0"}
    assert [output.settings["id"] for output in plan.outputs] == [1, 2, 3, 4, 5, 6, 7]
    sensor, _ = plan.sensors
    assert sensor.measures == "tendons"
    assert [*sensor.settings["tendons"]] == ["FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI"]
    assert GuardPlan.from_json(json.dumps(json.loads(plan.to_json()))) == plan


def test_layouts_are_in_newtons_and_metres() -> None:
    """Actions run from pretension at 0 to maximum at 1; states are length, speed and tension."""
    profile = load_profile(shipped_profiles()["finger"])
    action = profile.action_layout()["FDP"]
    assert (action.low, action.high, action.gain, action.gain_unit) == (0.0, 1.0, 14.0, "N")
    assert profile.action_layout()["LUM"].gain == pytest.approx(5.4)
    state = profile.state_layout()
    assert state.names[:2] == ("FDP/length", "FDS/length")
    assert [state[f"PI/{what}"].unit for what in ("length", "speed", "tension")] == [
        "m",
        "m/s",
        "N",
    ]
    assert state["PI/tension"].high == 15.0
    assert state.size == 32


def test_an_action_of_two_tendons_has_no_newtons() -> None:
    start, end = _TEXT.index("[action.FDS]"), _TEXT.index("[action.EIP]")
    text = changed("mix = { FDS = 1.0 }", "mix = { FDP = 1.0 }", _TEXT[:start] + _TEXT[end:])
    action = read(text).action_layout()["FDP"]
    assert (action.gain, action.gain_unit) == (1.0, "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_TEXT.replace(_BUS, ""), r"\[output.FDP\] is on a bus: add \[servo_bus\]"),
        (_TEXT.replace(_SENSOR, ""), "servos need one sensor with the driver bus_servo"),
        (_TEXT + _SENSOR.replace("tendons", "others"), "servos need one sensor"),
        (changed('then = "release"', 'then = "hold"', _TEXT), 'must be "release"'),
        (
            changed("\nid = 2\n", "\nid = 1\n", _TEXT),
            r"id 1 of the servo bus is used twice: by id of \[output.FDP\] \(line \d+\) and by",
        ),
        (
            _TEXT.replace("pretension_n = 1.0", "pretension_n = 30.0", 1),
            r"line 65: pretension_n of \[output.FDP\] must be",
        ),
        (changed("watchdog_ms = 100", "watchdog_ms = 90", _TEXT), "steps of 20 .*, not 90"),
        (_TEXT.replace("XL330-M077", "XL330-M078", 1), "did you mean 'XL330-M077'"),
        (
            shipped_profiles()["car"].read_text() + "\n[servo_bus]\n",
            "needs an output with the driver bus_servo",
        ),
        (
            shipped_profiles()["car"].read_text() + "\n" + _SENSOR,
            r"\[sensor.tendons\] needs an output with the driver bus_servo",
        ),
    ],
)
def test_an_invalid_bus_is_refused(text: str, words: str) -> None:
    """The error names the problem, with the line where there is one."""
    with pytest.raises(ProfileError, match=words):
        read(text)


_LENGTH = 'control = "length"\nlongest_m = 0.01\nshortest_m = -0.03\n'


def test_control_of_the_length_has_its_gain_in_metres() -> None:
    """The action of such a tendon goes from the longest to the shortest length."""
    text = _TEXT.replace("id = 1\n", "id = 1\n" + _LENGTH, 1)
    layout = read(text).action_layout()
    assert (layout["FDP"].gain, layout["FDP"].gain_unit) == (pytest.approx(0.04), "m")
    assert layout["FDS"].gain_unit == "N"


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (_LENGTH.replace('"length"', '"lenght"'), "did you mean \"?'?length"),
        ('control = "length"\n', "shortest_m .* must be below longest_m, not 0 and 0 m"),
    ],
)
def test_invalid_control_is_refused_with_its_line(keys: str, words: str) -> None:
    """A misspelt control and a missing range of lengths name the problem and its line."""
    with pytest.raises(ProfileError, match=r"line \d+: .*" + words):
        read(_TEXT.replace("id = 1\n", "id = 1\n" + keys, 1))


def test_a_feetech_rig_has_the_settings_of_its_power_switch() -> None:
    """Its outputs know how long the enable line holds, and how long the servos start."""
    profile = read(finger_text("Feetech") + "hold_ms = 50\n")
    settings = [output.settings for output in profile.outputs]
    assert {(one["model"], one["cut_ms"], one["arm_s"]) for one in settings} == {
        ("STS3215", 100, 0.5)
    }
    assert profile.action_layout()["FDP"].gain == pytest.approx(0.042)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('control = "length"', 'control = "tension"', "must be 'length', not 'tension', because a"),
        ("shortest_m = -0.03 ", "shortest_m = -0.04 ", "within 0.0314 m of the zero, half a turn"),
        ("[enable]\npin = 19", "", r"\[output.FDP\] is an STS3215.*: add \[enable\] with the pin"),
        (
            "baud = 1_000_000",
            "baud = 2_000_000",
            "baud of .* must be one .*38400.*, not 2000000",
        ),
        ('model = "STS3215"', 'model = "XL330-M077"', "cannot have Dynamixel and Feetech servos"),
    ],
)
def test_what_feetech_servos_cannot_do_is_refused(old: str, new: str, words: str) -> None:
    """One sentence names the line and the reason."""
    with pytest.raises(ProfileError, match=r"line \d+: .*" + words):
        read(finger_text("Feetech").replace(old, new, 1))
