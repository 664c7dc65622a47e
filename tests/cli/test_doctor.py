"""The command `shapechanger doctor`."""

from __future__ import annotations

import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from shapechanger.cli import main
from shapechanger.cli.doctor import examine_machine
from shapechanger.robot.check.report import Finding

REQUIREMENTS = (
    "core-package>=2",
    'learner<3,>=1; extra == "learn"',
    'pins>=1; (sys_platform == "nothing") and extra == "robot"',
    'shapechanger[learn]; extra == "all"',
)


def findings(installed: dict[str, str], dev: Path = Path("/nowhere")) -> dict[str, Finding]:
    def version_of(package: str) -> str:
        if package not in installed:
            raise PackageNotFoundError(package)
        return installed[package]

    return {each.check: each for each in examine_machine(REQUIREMENTS, version_of, dev)}


def test_an_extra_that_is_not_installed_is_named_with_its_command() -> None:
    """Missing extras are not errors; packages for other systems, and `all`, are not checked."""
    results = findings({"core-package": "2.5"})
    assert results["core"].level == "good"
    assert results["extra learn"].level == "unknown"
    assert "Not installed: learner" in results["extra learn"].sentence
    assert "pip install --upgrade 'shapechanger[learn]'" in results["extra learn"].sentence
    assert results["extra robot"].level == "good"
    assert "extra all" not in results
    results = findings({"core-package": "1.9", "learner": "3.0"})
    assert results["core"].level == results["extra learn"].level == "bad"
    assert "core-package must be >=2, got 1.9" in results["core"].sentence


def test_pins_that_may_not_be_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gpiochip0").touch()
    assert findings({}, tmp_path)["pins"].level == "good"
    monkeypatch.setattr("os.access", lambda path, mode: False)
    refused = findings({}, tmp_path)["pins"]
    assert refused.level == "bad"
    assert "usermod -aG gpio" in refused.sentence


def test_a_renderer_that_dies_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """A crash of the OpenGL driver ends only the process that renders."""
    died = SimpleNamespace(returncode=-11, stdout="", stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *command, **options: died)
    assert findings({"mujoco": "4.0.0"})["images"] == Finding("images", "bad", "exit status -11")


@pytest.mark.system
@pytest.mark.gl
def test_this_machine_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--version"])
    program = f"shapechanger {version('shapechanger')}"
    assert capsys.readouterr().out == f"{program}\n"
    main(["doctor"])
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith(f"good  machine: {program}") for line in lines)
    assert any(line.startswith("good  images: Drew 480 x 480 with") for line in lines)
    assert not any("BAD" in line for line in lines)


def test_a_bad_finding_sets_the_exit_status(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken: list[Any] = [Finding("core", "bad", "Gone.")]
    monkeypatch.setattr("shapechanger.cli.doctor.examine_machine", lambda: broken)
    with pytest.raises(SystemExit) as stop:
        main(["doctor"])
    assert stop.value.code == 1
    assert "0 good, 1 bad, 0 not measured." in capsys.readouterr().out
