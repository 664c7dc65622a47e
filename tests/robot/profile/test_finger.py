"""The finger's profile: its servo bus and the encoders at its joints."""

import math
import re

import pytest

from shapechanger.errors import ProfileError
from shapechanger.robot.profile import load_profile, shipped_profiles
from tests.robot.profile.texts import changed, finger_text, read

_TEXT = shipped_profiles()["finger"].read_text()
_PROFILE = load_profile(shipped_profiles()["finger"])
_CAR = shipped_profiles()["car"].read_text()


def _part(begin: str, end: str) -> str:
    return _TEXT[_TEXT.index(begin) : _TEXT.index(end)]


_BUS = _part("[servo_bus]", "[action.FDP]")
_TENDONS = _part("[sensor.tendons]", "[sensor.joints]")
_JOINTS = _part("[sensor.joints]", "[limits]")
_MORE = _JOINTS.replace(".joints", ".more")


def test_settings_are_plain_numbers_in_file_order() -> None:
    """Outputs have the settings of the bus, and the sensor of the bus has its tendons."""
    plan = _PROFILE.guard_plan()
    assert {str(output.settings["device"]) for output in plan.outputs} == {"/dev/ttyUSB0"}
    assert [output.settings["id"] for output in plan.outputs] == [1, 2, 3, 4, 5, 6, 7]
    tendons, joints = plan.sensors
    assert tendons.measures == "tendons"
    assert [*tendons.settings["tendons"]] == ["FDP", "FDS", "EIP", "EDC", "LUM", "DI", "PI"]
    assert (joints.driver, joints.measures) == ("as5600", "joints")
    assert joints.settings == {
        "bus": 1,
        "mux": 0x70,
        "rows": {
            joint: {"channel": channel, "zero": 0, "direction": 1}
            for channel, joint in enumerate(
                ("MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion")
            )
        },
    }


def test_layouts_are_in_newtons_metres_and_radians() -> None:
    """An action of 0 is the pretension, 1 the largest tension; states list tendons, then joints."""
    action = _PROFILE.action_layout()["FDP"]
    assert (action.low, action.high, action.gain, action.gain_unit) == (0.0, 1.0, 14.0, "N")
    assert _PROFILE.action_layout()["LUM"].gain == pytest.approx(5.4)
    state = _PROFILE.state_layout()
    assert state.names[:2] == ("FDP/length", "FDS/length")
    units = [state[f"PI/{name}"].unit for name in ("length", "speed", "tension")]
    assert units == ["m", "m/s", "N"]
    assert state["PI/tension"].high == 15.0
    assert state.size == 32
    angle = state["MCP_abduction/angle"]
    assert (angle.unit, angle.low, angle.high) == ("rad", -math.pi, math.pi)
    joints = ("MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion")
    assert state.names[21:25] == tuple(f"{name}/angle" for name in joints)
    blind = read(_TEXT.replace(_JOINTS, "")).state_layout()
    assert not [name for name in blind.names if name.endswith("/angle")]


def test_the_gain_of_an_action_is_in_the_unit_that_its_servo_controls() -> None:
    """For a length, the gain is longest less shortest, m; an action of two tendons has no unit."""
    keys = 'id = 1\ncontrol = "length"\nlongest_m = 0.01\nshortest_m = -0.03\n'
    both = _TEXT.replace(_part("[action.FDS]", "[action.EIP]"), "")
    for text, gain, unit in (
        (_TEXT.replace("id = 1\n", keys, 1), 0.04, "m"),
        (changed("mix = { FDS = 1.0 }", "mix = { FDP = 1.0 }", both), 1.0, ""),
    ):
        action = read(text).action_layout()["FDP"]
        assert (action.gain, action.gain_unit) == (pytest.approx(gain), unit)


def test_a_feetech_rig_has_the_settings_of_its_power_switch() -> None:
    """The plan has the time until the enable line cuts the power, and the servos' boot time."""
    profile = read(finger_text("Feetech") + "hold_ms = 50\n")
    settings = {
        (o.settings["model"], o.settings["cut_ms"], o.settings["arm_s"]) for o in profile.outputs
    }
    assert settings == {("STS3215", 100, 0.5)}
    assert profile.action_layout()["FDP"].gain == pytest.approx(0.042)


# First occurrence to replace in the finger's profile, its replacement, and part of the message.
_TABLE = r"""
channel = 3\n -> channel = 2\n -> has the channel 2, which PIP_flexion has, too
channel = 3\n -> channel = 8\n -> from 0 to 7
channel = 3\n ->  -> lacks the key 'channel'
[sensor.joints.DIP_flexion] -> [sensor.joints.3] -> the name '3' must
mux = 0x70 -> mux = 0x68 -> from 112 to 119
direction = 1 -> direction = 0 -> must be one of -1, 1, not 0
then = "release" -> then = "hold" -> must be "release"
\nid = 2\n -> \nid = 1\n -> id 1 of the servo bus is used twice: by id of [output.FDP]
watchdog_ms = 100 -> watchdog_ms = 90 -> in steps of 20 from 20 to 2540, not 90
"""
_FEETECH = r"""
shortest_m = -0.03  -> shortest_m = -0.04  -> within 0.0314 m of the zero, half a turn
[enable]\npin = 19 ->  -> [output.FDP] is an STS3215, which does not stop when its bus is
model = "STS3215" -> model = "XL330-M077" -> cannot have Dynamixel and Feetech servos
"""
_MISTAKES = [
    (_TEXT.replace(_BUS, ""), "[output.FDP] is on a bus: add [servo_bus]"),
    (_TEXT.replace(_TENDONS, ""), "servos need one sensor with the driver bus_servo"),
    (_TEXT + _TENDONS.replace("tendons", "others"), "servos need one sensor"),
    (f"{_CAR}\n[servo_bus]\n", "[servo_bus] needs an output with the driver bus_servo"),
    (f"{_CAR}\n{_TENDONS}", "[sensor.tendons] needs an output with the driver bus_servo"),
    (_TEXT.replace(_JOINTS, _JOINTS.split("[sensor.joints.")[0]), "needs a table for each joint"),
    (_TEXT + _MORE, "address 0x70 of I2C bus 1 is used twice"),
    (_TEXT + _MORE.replace("mux = 0x70", "mux = 0x71"), "address 0x36 of I2C bus 1 is used twice"),
]
for _base, _rows in ((_TEXT, _TABLE), (finger_text("Feetech"), _FEETECH)):
    for _row in _rows.strip("\n").split("\n"):
        _old, _new, _words = _row.replace(r"\n", "\n").split(" -> ")
        assert _old in _base, _old
        _MISTAKES.append((_base.replace(_old, _new, 1), _words))


@pytest.mark.parametrize(("text", "message"), _MISTAKES, ids=[message for _, message in _MISTAKES])
def test_the_error_names_the_mistake(text: str, message: str) -> None:
    with pytest.raises(ProfileError, match=rf"line \d+: .*{re.escape(message)}"):
        read(text)
