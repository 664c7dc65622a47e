"""The plan that processes inherit, and the modules that guard and supervisor import."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan, output_values
from shapechanger.robot.guard import outputs as safe_pins
from shapechanger.robot.guard import start, supervisor
from shapechanger.robot.guard.serve_plan import (
    ServePlan,
    descriptors,
    plan_fd,
    read_plan_fd,
    supervisor_command,
)
from shapechanger.robot.guard.supervisor import Restarts
from tests.robot.guard.plans import car
from tests.robot.guard.recording import Record, connect

pytestmark = pytest.mark.realtime

_PLAN = ServePlan(car(), {"port": 5000, "nested": {"a": [1, 2]}}, ("module:function", "argument"))


def test_a_plan_round_trips() -> None:
    plan = replace(_PLAN, guard=replace(car(), actions=(ActionPlan("throttle"),)))
    assert ServePlan.from_json(plan.to_json()) == plan


def test_processes_may_be_silent_for_their_limits() -> None:
    assert (_PLAN.guard_silence_ms, _PLAN.daemon_silence_ms) == (250, 2_000)
    patient = replace(_PLAN, patience_ms=5_000)
    assert (patient.guard_silence_ms, patient.daemon_silence_ms) == (5_000, 5_000)


def test_several_processes_can_read_the_plan() -> None:
    fd = plan_fd(_PLAN)
    try:
        assert os.get_inheritable(fd)
        assert read_plan_fd(fd) == _PLAN
        script = f"import os; print(os.pread({fd}, 1 << 20, 0).decode())"
        text = subprocess.check_output([sys.executable, "-c", script], pass_fds=[fd], text=True)
        assert ServePlan.from_json(text) == _PLAN
        assert read_plan_fd(fd) == _PLAN
    finally:
        os.close(fd)


def test_a_plan_is_read_only() -> None:
    fd = plan_fd(_PLAN)
    try:
        for change in (lambda: os.pwrite(fd, b"x", 0), lambda: os.ftruncate(fd, 0)):
            with pytest.raises(PermissionError):
                change()
        assert read_plan_fd(fd) == _PLAN
    finally:
        os.close(fd)


def test_outputs_are_mixed_from_actions_and_clipped() -> None:
    plan = GuardPlan(
        "tank",
        (ActionPlan("steering"), ActionPlan("throttle")),
        (
            OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
            OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}, offset=0.25),
        ),
    )
    assert output_values(plan, (0.5, 0.25)) == (0.75, 0.0)
    assert output_values(plan, (1.0, 1.0)) == (1.0, 0.25)
    assert output_values(plan, (-1.0, -1.0)) == (-1.0, 0.25)
    with pytest.raises(ValueError, match="has 2 actions"):
        output_values(plan, (1.0,))


def test_restarts_are_limited_per_period() -> None:
    restarts = Restarts(most=2, within_s=60.0)
    second = 10**9
    assert [restarts.may_restart(t * second) for t in (0, 30, 59, 60, 61, 90)] == [
        True,
        True,
        False,
        True,
        False,
        True,
    ]


def test_restarts_back_off() -> None:
    restarts = Restarts()
    pauses = [restarts.pause_s for t in range(5) if restarts.may_restart(t)]
    assert pauses == pytest.approx([0.0, 0.2, 0.6, 1.4, 3.0])


@pytest.mark.parametrize("arguments", [["--a", "1"], ["--a", "1", "--c", "2"], ["--a"]])
def test_wrong_arguments_are_refused(arguments: list[str]) -> None:
    with pytest.raises(ValueError, match=r"This takes --a N --b N|argument 2 is"):
        descriptors(arguments, ("--a", "--b"))


def test_processes_ignore_the_working_folder() -> None:
    commands = supervisor.ProcessCommands.of(_PLAN)
    assert commands.guard == (sys.executable, "-I", start.__file__, "guard")
    assert supervisor_command(_PLAN, 7)[1:] == ["-I", start.__file__, "supervise", "--plan-fd", "7"]
    assert commands.daemon == (sys.executable, "-P", "-m", "shapechanger.robot.daemon")


def test_make_safe_continues_after_a_failed_output(tmp_path: Path) -> None:
    record = Record(tmp_path / "record")
    (tmp_path / "stuck-GPIO17").touch()
    plan = replace(car(), enable_pin=5)
    failures = safe_pins.make_safe(plan, connect(str(record.path)))
    assert len(failures) == 1
    assert failures[0].startswith("Output steer: ")
    assert {line["pin"] for line in record.pins()} >= {"GPIO22", "GPIO27", "GPIO5"}
    assert record.is_at_rest()
    (tmp_path / "stuck-GPIO17").unlink()
    assert not safe_pins.make_safe(plan, connect(str(record.path)))
    (tmp_path / "stuck-GPIO5").touch()
    assert "Enable pin 5" in safe_pins.make_safe(plan, connect(str(record.path)))[0]


_LISTS_MODULES = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("start", sys.argv[1])
start = importlib.util.module_from_spec(spec)
spec.loader.exec_module(start)
start._put_package_in_place()
import importlib
for module in ("process", "supervisor"):
    importlib.import_module(f"shapechanger.robot.guard.{module}")
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
for chips in (OUTPUTS, PULSES, SENSORS):
    list(chips.values())
print(*sys.modules)
"""


def test_guard_and_supervisor_import_only_their_drivers() -> None:
    command = [sys.executable, "-I", "-c", _LISTS_MODULES, start.__file__]
    before = "import sys; print(*sys.modules)"
    bare = subprocess.check_output([sys.executable, "-I", "-c", before], text=True).split()
    loaded = subprocess.check_output(command, text=True).split()
    # gpiozero and msgspec prefer backports where another package has brought them.
    backport = {"importlib_metadata", "lazy_importer", "typing_extensions", "zipp"}
    theirs = {"gpiozero", "colorzero", "lgpio", "_lgpio", "smbus2", "msgspec", "start"} | backport
    for module in set(loaded) - set(bare):
        top = module.partition(".")[0]
        if top == "shapechanger":
            ours = module.split(".")[1:2]
            assert ours in ([], ["errors"], ["robot"], ["contract"]), module
            inner = ["guard", "drivers", "hardware", "plan", "limits", "duty"]
            assert module.split(".")[2:3] in ([], *([one] for one in inner)), module
        else:
            assert top in theirs or top in sys.stdlib_module_names, module
