"""Keys of chips, as they reach their drivers."""

import pytest

from shapechanger.contract.plan import GuardPlan
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.profile import load_profile, shipped_profiles


@pytest.mark.parametrize("name", sorted(shipped_profiles()))
def test_a_driver_reads_the_keys_of_its_profile_from_a_plan(name: str) -> None:
    """The settings of a plan survive JSON, and are the same keys again."""
    plan = load_profile(shipped_profiles()[name]).guard_plan()
    assert GuardPlan.from_json(plan.to_json()) == plan
    pulsed = [output for output in plan.outputs if "over" in output.settings]
    for part, chip in (
        *((output, OUTPUTS[output.driver]) for output in plan.outputs),
        *((output, PULSES[output.settings["over"]]) for output in pulsed),
        *((sensor, SENSORS[sensor.driver]) for sensor in plan.sensors),
    ):
        keys = chip.keys.of(part.settings)
        assert chip.keys.of(keys.settings()) == keys
        assert keys.settings().items() <= part.settings.items()
