"""Vehicles by name, and the parts that fit them."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import pytest

from shapechanger.errors import ProfileError, UnknownName
from shapechanger.vehicles.bodies import VEHICLES, add_vehicle, require_fit, vehicle_model
from shapechanger.vehicles.bodies.parts import HOBBY_MOTOR, HOBBY_SERVO


def test_names_are_consistent() -> None:
    assert {name: model.name for name, model in VEHICLES.items()} == {n: n for n in VEHICLES}
    assert set(VEHICLES) == {"car", "tank", "truck", "boat"}
    assert [name for name, model in VEHICLES.items() if model.floats] == ["boat"]


def test_an_unknown_name_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match=r"Did you mean 'truck'\?"):
        vehicle_model("truk")
    with pytest.raises(UnknownName):
        add_vehicle(mujoco.MjSpec(), "plane")


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("car", {"wheels", "steering"}),
        ("truck", {"wheels", "steering"}),
        ("truck", {"wheels", "steering", "gear", "bed"}),
        ("tank", {"left track", "right track"}),
        ("boat", {"propeller", "rudder"}),
        ("boat", {"left propeller", "right propeller"}),
    ],
)
def test_robots_that_fit(name: str, parts: set[str]) -> None:
    """The parts of the shipped profiles fit."""
    require_fit(name, parts)


@pytest.mark.parametrize(
    ("name", "parts", "message"),
    [
        ("car", {"left track", "right track"}, "A car has no 'left track' or 'right track'."),
        ("car", {"wheels"}, "The robot drives 'wheels'; a car is driven by 'steering' and"),
        ("car", set[str](), "The robot drives nothing;"),
        ("car", {"wheels", "steering", "bed"}, "A car has no 'bed'."),
        ("truck", {"gear"}, "The robot drives nothing;"),
        ("boat", {"propeller", "left propeller", "right propeller"}, ", or by 'left propeller'"),
    ],
)
def test_robots_that_do_not_fit(name: str, parts: set[str], message: str) -> None:
    """The error lists the parts of the robot and the vehicle."""
    with pytest.raises(ProfileError) as caught:
        require_fit(name, parts)
    assert message in str(caught.value)


@pytest.mark.parametrize("degrees", [True, False])
def test_the_unit_of_angles_in_the_model_does_not_matter(degrees: bool) -> None:
    """Vehicles fit models in degrees and in radians."""
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
    """A lossless gear keeps the power."""
    geared = HOBBY_MOTOR.geared(3.0)
    assert geared.amperes(6.0, 10.0) == pytest.approx(HOBBY_MOTOR.amperes(6.0, 30.0))
    assert geared.torque_per_current == pytest.approx(3.0 * HOBBY_MOTOR.torque_per_current)
    assert geared.rotor_inertia == pytest.approx(9.0 * HOBBY_MOTOR.rotor_inertia)
    assert HOBBY_MOTOR.geared(3.0, 0.5).friction == pytest.approx(1.5 * HOBBY_MOTOR.friction)


def test_a_braking_motor_draws_no_current() -> None:
    """A motor that turns faster than its voltage drives it draws no current."""
    assert HOBBY_MOTOR.amperes(0.0, 100.0) == 0.0
    assert HOBBY_MOTOR.amperes(1.0, 100.0) == 0.0
    assert HOBBY_MOTOR.amperes(-6.0, -100.0) == HOBBY_MOTOR.amperes(6.0, 100.0) > 0.0


def test_a_servo_turns_at_its_rate_under_full_torque() -> None:
    """The damping follows from torque and speed."""
    servo = replace(HOBBY_SERVO, stall_torque=0.5, free_rate=5.0)
    assert servo.damping == pytest.approx(0.1)
