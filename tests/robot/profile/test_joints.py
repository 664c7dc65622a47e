"""Joint encoders in a profile."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from shapechanger.contract.plan import GuardPlan
from shapechanger.errors import ProfileError
from shapechanger.robot.profile import load_profile, shipped_profiles, write_profile
from shapechanger.robot.profile.load import rewrite
from tests.robot.profile.texts import changed, read

_TEXT = shipped_profiles()["finger"].read_text()
_SENSOR = _TEXT[_TEXT.index("[sensor.joints]") : _TEXT.index("[limits]")]
_HEAD = _SENSOR[: _SENSOR.index("[sensor.joints.MCP_flexion]")]


def test_encoder_settings_are_lists_in_file_order() -> None:
    """The guard's settings are plain numbers, which round-trip through JSON."""
    plan = load_profile(shipped_profiles()["finger"]).guard_plan()
    sensor = plan.sensors[-1]
    assert (sensor.driver, sensor.measures) == ("as5600", "joints")
    assert sensor.settings == {
        "bus": 1,
        "mux": 0x70,
        "joints": ["MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion"],
        "channels": [0, 1, 2, 3],
        "zeros": [0, 0, 0, 0],
        "directions": [1, 1, 1, 1],
    }
    assert GuardPlan.from_json(json.dumps(json.loads(plan.to_json()))) == plan


def test_the_state_has_an_angle_of_each_joint() -> None:
    """Angles are in rad within half a turn, after lengths, speeds and tensions."""
    state = load_profile(shipped_profiles()["finger"]).state_layout()
    angle = state["MCP_abduction/angle"]
    assert (angle.unit, angle.low, angle.high) == ("rad", -math.pi, math.pi)
    assert state.names[21:25] == tuple(
        f"{name}/angle" for name in ("MCP_flexion", "MCP_abduction", "PIP_flexion", "DIP_flexion")
    )


def test_a_finger_without_encoders_is_valid() -> None:
    """Its state then has no angles."""
    profile = read(_TEXT.replace(_SENSOR, ""))
    assert [sensor.name for sensor in profile.sensors] == ["tendons"]
    assert not [name for name in profile.state_layout().names if name.endswith("/angle")]


def test_a_zero_can_be_rewritten(tmp_path: Path) -> None:
    """`rewrite` sets the zero as `robot home` does, and keeps comments."""
    path = write_profile("finger", tmp_path / "mine.toml", "mine")
    profile = rewrite(path, {"sensor.joints.PIP_flexion.zero": 1234})
    assert profile.sensors[-1].settings["zeros"] == [0, 0, 1234, 0]
    assert "# Counts while the finger is straight." in path.read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (_TEXT.replace(_SENSOR, _HEAD), r"needs a table for each joint, such as \[sensor.joints."),
        (
            changed("channel = 3\n", "channel = 2\n", _TEXT),
            r"DIP_flexion of .* has the channel 2, .* PIP_flexion has, too",
        ),
        (changed("channel = 3\n", "channel = 8\n", _TEXT), "channel of .* from 0 to 7"),
        (changed("channel = 3\n", "chanel = 3\n", _TEXT), "did you mean 'channel'"),
        (changed("channel = 3\n", "", _TEXT), "lacks the key 'channel'"),
        (_TEXT.replace("[sensor.joints.DIP_flexion]", "[sensor.joints.3]"), "the name '3' must"),
        (changed("mux = 0x70", "mux = 0x68", _TEXT), "mux of .*from 112 to 119"),
        (changed("mux = 0x70", "mox = 0x70", _TEXT), r"\[sensor.joints\] has no key 'mox'"),
        (_TEXT + _SENSOR.replace(".joints", ".more"), "address 0x70 of I2C bus 1 is used twice"),
        (
            _TEXT + _SENSOR.replace(".joints", ".more").replace("mux = 0x70", "mux = 0x71"),
            "address 0x36 of I2C bus 1 is used twice",
        ),
        (
            "direction = 0".join(_TEXT.rsplit("direction = 1", 1)),
            r"direction of \[sensor.joints.DIP_flexion\] must be one of -1, 1, not 0",
        ),
    ],
)
def test_invalid_encoders_are_refused(text: str, words: str) -> None:
    """The error names the line and the problem."""
    with pytest.raises(ProfileError, match=f"line [0-9]+: .*{words}"):
        read(text)
