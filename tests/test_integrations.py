"""Packages below `integrations`, as far as they can be checked without what they integrate."""

from __future__ import annotations

import ast
import importlib
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
LEROBOT = ROOT / "integrations" / "lerobot_robot_shapechanger"
FILES = sorted(LEROBOT.rglob("*.py"))


def _project(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "pyproject.toml").read_text())["project"]


def _imports_of_ours(file: Path) -> Iterator[tuple[str, str]]:
    """Yield module and name of each import from `shapechanger`."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "shapechanger":
            yield from ((node.module or "", alias.name) for alias in node.names)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_what_the_package_imports_from_here_exists(file: Path) -> None:
    """A name that is renamed here is renamed there too."""
    for module, name in _imports_of_ours(file):
        found = importlib.import_module(module)
        if not hasattr(found, name):
            importlib.import_module(f"{module}.{name}")


@pytest.mark.parametrize(
    "file", sorted(LEROBOT.glob("tests/test_*.py")), ids=lambda file: file.stem
)
def test_shared_test_modules_exist(file: Path) -> None:
    """The package's tests import from `tests` here without that name, because draccus takes it."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("robot."):
            assert (
                (ROOT / "tests" / (node.module or "").replace(".", "/"))
                .with_suffix(".py")
                .is_file()
            )


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
