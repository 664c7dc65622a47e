"""Vehicles by name, and the parts that fit them."""

from __future__ import annotations

import mujoco
import pytest

from shapechanger.errors import ProfileError, UnknownName
from shapechanger.vehicles.bodies import add_vehicle, require_fit, vehicle_model
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"Did you mean 'truck'\?"):
        vehicle_model("truk")
    with pytest.raises(UnknownName):
        add_vehicle(mujoco.MjSpec(), "plane")


@pytest.mark.parametrize(
    ("name", "parts", "message"),
    [
        ("car", {"wheels"}, "The robot drives 'wheels'; a car is driven by 'steering' and"),
        (
            "car",
            {"wheels", "steering", "bed"},
            "The robot drives 'bed' and 'steering' and",
        ),
        ("truck", {"gear"}, "The robot drives nothing;"),
        ("boat", {"propeller", "left propeller", "right propeller"}, ", or by 'left propeller'"),
    ],
)
def test_robots_that_do_not_fit(name: str, parts: set[str], message: str) -> None:
    with pytest.raises(ProfileError) as caught:
        require_fit(name, parts)
    assert message in str(caught.value)


@pytest.mark.parametrize("degrees", [True, False])
def test_the_unit_of_angles_in_the_model_does_not_matter(degrees: bool) -> None:
    spec = mujoco.MjSpec()
    spec.compiler.degree = degrees
    add_vehicle(spec, "truck")
    limits = spec.compile().joint("vehicle/trailer yaw").range
    assert limits == pytest.approx((-1.4835, 1.4835), abs=1e-3)


def test_the_motor_matches_its_data_sheet() -> None:
    """At 6 V: 6 A and 1.2 kgf·cm when stalled, 0.5 A at 2200 turns a minute without load."""
    free = 2200.0 * 2.0 * 3.141592653589793 / 60.0
    assert HOBBY_MOTOR.amperes(6.0, 0.0) == pytest.approx(6.0)
    assert HOBBY_MOTOR.amperes(6.0, free) == pytest.approx(0.5)
    assert HOBBY_MOTOR.torque_per_current * 6.0 == pytest.approx(1.2 * 0.0980665)


def test_a_gear_trades_speed_for_torque() -> None:
    geared = HOBBY_MOTOR.geared(3.0)
    assert geared.amperes(6.0, 10.0) == pytest.approx(HOBBY_MOTOR.amperes(6.0, 30.0))
    assert geared.torque_per_current == pytest.approx(3.0 * HOBBY_MOTOR.torque_per_current)
    assert geared.rotor_inertia == pytest.approx(9.0 * HOBBY_MOTOR.rotor_inertia)
    assert HOBBY_MOTOR.geared(3.0, 0.5).friction == pytest.approx(1.5 * HOBBY_MOTOR.friction)


def test_a_braking_motor_draws_no_current() -> None:
    assert HOBBY_MOTOR.amperes(0.0, 100.0) == 0.0
    assert HOBBY_MOTOR.amperes(1.0, 100.0) == 0.0
    assert HOBBY_MOTOR.amperes(-6.0, -100.0) == HOBBY_MOTOR.amperes(6.0, 100.0) > 0.0
