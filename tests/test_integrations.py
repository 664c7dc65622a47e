"""Packages below `integrations`, as far as they can be checked without what they integrate."""

from __future__ import annotations

import ast
import importlib
import tomllib
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
LEROBOT = ROOT / "integrations" / "lerobot_robot_shapechanger"
FILES = sorted(LEROBOT.rglob("*.py"))


def _project(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_imported_names_exist(file: Path) -> None:
    """Modules and names of Shapechanger that the package imports exist.

    Tests of the package import `robot` and not `tests.robot`, because draccus installs a package
    `tests`.
    """
    for node in ast.walk(ast.parse(file.read_text())):
        module = (isinstance(node, ast.ImportFrom) and node.module) or ""
        if module.split(".")[0] == "shapechanger":
            found = importlib.import_module(module)
            for alias in node.names:
                if not hasattr(found, alias.name):
                    importlib.import_module(f"{module}.{alias.name}")
        elif module.startswith("robot."):
            assert (ROOT / "tests" / f"{module.replace('.', '/')}.py").is_file()


def test_lerobot_finds_the_package() -> None:
    """LeRobot imports modules whose distribution has this prefix."""
    project = _project(LEROBOT)
    assert project["name"].startswith("lerobot_robot_")
    assert (LEROBOT / project["name"] / "__init__.py").is_file()


def test_the_pins_of_lerobot_lie_inside_the_range() -> None:
    """`make test-lerobot` tests a version that the package allows."""
    (wanted,) = (
        requirement
        for requirement in map(Requirement, _project(LEROBOT)["dependencies"])
        if requirement.name == "lerobot"
    )
    lines = (LEROBOT / "constraints.txt").read_text().splitlines()
    pins = dict(line.split("==") for line in lines if "==" in line)
    assert wanted.specifier.contains(pins["lerobot"])
