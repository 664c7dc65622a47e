"""The shipped profiles, and how they map commands to outputs."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.contract.plan import GuardPlan, output_values
from shapechanger.robot.profile import load_profile, shipped_profiles
from tests.robot.profile.texts import HOVERCRAFT, read

NAMES = (
    *("boat", "boat-twin", "car", "car-esc", "cat", "finger", "finger-pwm"),
    *("lab-boat", "lab-car", "lab-tank", "lab-truck", "tank", "truck"),
)
PLANS = {name: load_profile(path).guard_plan() for name, path in shipped_profiles().items()}
SIDE = st.floats(-1.0, 1.0)


def values(plan: GuardPlan, actions: Sequence[float]) -> dict[str, float]:
    names = [output.name for output in plan.outputs]
    return dict(zip(names, output_values(plan, actions), strict=True))


def test_every_shipped_profile_has_the_name_of_its_file() -> None:
    assert tuple(shipped_profiles()) == NAMES
    assert {name: plan.name for name, plan in PLANS.items()} == {name: name for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_nothing_drives_at_rest(name: str) -> None:
    plan = PLANS[name]
    at_rest = values(plan, [action.rest for action in plan.actions])
    propelling = {action.name for action in plan.actions if action.propels}
    for output in plan.outputs:
        if propelling & output.mix.keys() or output.part in ("steering", "rudder"):
            assert at_rest[output.name] == 0.0


@given(steering=SIDE, throttle=SIDE)
def test_tracks_and_twin_propellers_mix(steering: float, throttle: float) -> None:
    """Outputs are clip(throttle + steering) on the left, clip(throttle - steering) on the right."""
    expected = {
        "left": max(-1.0, min(1.0, throttle + steering)),
        "right": max(-1.0, min(1.0, throttle - steering)),
    }
    assert values(PLANS["tank"], [steering, throttle]) == pytest.approx(expected, abs=1e-12)
    assert values(PLANS["boat-twin"], [steering, throttle]) == pytest.approx(expected, abs=1e-12)


@given(steering=SIDE, throttle=SIDE)
def test_outputs_of_cars_and_boats_keep_the_sign(steering: float, throttle: float) -> None:
    """-1 is left and backward, 1 right and forward, on every output."""
    for name, drive, steer in (
        ("car", "drive", "steer"),
        ("car-esc", "drive", "steer"),
        ("truck", "drive", "steer"),
        ("boat", "propeller", "rudder"),
    ):
        plan = PLANS[name]
        assert [action.name for action in plan.actions][:2] == ["steering", "throttle"]
        rest = [action.rest for action in plan.actions[2:]]
        outputs = values(plan, [steering, throttle, *rest])
        assert outputs[drive] * throttle >= 0.0
        assert outputs[steer] * steering >= 0.0
        assert abs(outputs[drive]) <= abs(throttle)


def test_power_and_posture_equal_the_original_release() -> None:
    """The car drives with 60 % and steers with 40 %; the cat rests in its posture of 2017."""
    for side in (1.0, -1.0):
        assert values(PLANS["car"], [side, side]) == {"drive": 0.6 * side, "steer": 0.4 * side}
    degrees = [85.0 + action.gain * action.rest for action in PLANS["cat"].actions]
    assert degrees == pytest.approx([55.0, 92.0, 55.0] * 4, abs=0.01)
    assert [output.settings["channel"] for output in PLANS["cat"].outputs] == list(range(12))


@given(pull=st.lists(st.floats(0.0, 1.0), min_size=7, max_size=7))
def test_tendons_pull_one_to_one(pull: list[float]) -> None:
    """Each tendon has a servo, which is at its two ends when the tendon is slack and taut."""
    outputs = values(PLANS["finger-pwm"], pull)
    assert list(outputs) == ["EIP", "DI", "PI", "FDP", "FDS", "LUM", "EDC"]
    assert list(outputs.values()) == pytest.approx([2.0 * p - 1.0 for p in pull])


def test_a_profile_alone_can_define_a_vehicle() -> None:
    profile = read(HOVERCRAFT)
    assert profile.body == "hovercraft"
    plan = profile.guard_plan()
    assert profile.action_layout().names == ("steering", "throttle", "lift")
    assert list(profile.action_layout().low) == [-1.0, -1.0, 0.0]
    assert values(plan, [-0.5, 0.25, 1.0]) == {
        "fan": 0.25,
        "lift_fan": 1.0,
        "left_rudder": -0.5,
        "right_rudder": -0.4,
    }
    assert set(values(plan, [0.0, 0.0, 0.0]).values()) == {0.0}


def test_commented_sensors_of_the_car_work() -> None:
    text = shipped_profiles()["car"].read_text()
    lines = text.split("\n")
    begin = lines.index("# [sensor.wheel]")
    sensors = [line.removeprefix("# ") for line in lines[begin : lines.index("[reward]")]]
    whole = "\n".join([*lines[:begin], *sensors, *lines[lines.index("[reward]") :]])
    assert [sensor.measures for sensor in read(whole).sensors] == ["speed", "bump"]
