"""What a fresh clone is set up from: pyproject.toml, constraints.txt, typings."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

_ROOT = Path(__file__).resolve().parents[1]
_PYPROJECT: dict[str, Any] = tomllib.loads((_ROOT / "pyproject.toml").read_text())
_EXTRAS: dict[str, list[str]] = _PYPROJECT["project"]["optional-dependencies"]


def _pins() -> dict[str, str]:
    """The version that constraints.txt holds each package to."""
    lines = (_ROOT / "constraints.txt").read_text().splitlines()
    pins = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pins}


def _requirements() -> Iterator[tuple[str, Requirement]]:
    """Each requirement on somebody else's package, with where it is stated."""
    groups = {"dependencies": _PYPROJECT["project"]["dependencies"], **_EXTRAS}
    for group, lines in groups.items():
        for requirement in map(Requirement, lines):
            if requirement.name != "shapechanger":
                yield group, requirement


@pytest.mark.parametrize(
    "requirement", [pytest.param(r, id=f"{group}-{r.name}") for group, r in _requirements()]
)
def test_every_requirement_is_pinned_inside_its_range(requirement: Requirement) -> None:
    """What is tested is what pyproject.toml allows."""
    pin = _pins()[canonicalize_name(requirement.name)]
    assert requirement.specifier.contains(pin)


@pytest.mark.parametrize(("name", "version"), _pins().items())
def test_pins_fit_every_platform(name: str, version: str) -> None:
    """A local version, such as torch's +cpu, exists for some machines only."""
    assert Version(version).local is None, name


def test_all_is_the_sum_of_the_extras_for_users() -> None:
    """Who installs `all` misses nothing but the tools for developers."""
    (everything,) = map(Requirement, _EXTRAS["all"])
    assert everything.extras == set(_EXTRAS) - {"all", "dev"}


def test_stubs_describe_the_pinned_mujoco() -> None:
    """A new MuJoCo needs new stubs, or pyright checks against the old one."""
    header = (_ROOT / "typings/mujoco/__init__.pyi").read_text().splitlines()[0]
    assert f"Generated from mujoco {_pins()['mujoco']} " in header


@pytest.mark.parametrize(
    "module", ["errors", "layout", "morphology", "transfer/body_map", "transfer/metrics"]
)
def test_coverage_gate_finds_the_module(module: str) -> None:
    """A module that is renamed must not slip past the gate."""
    patterns: list[str] = _PYPROJECT["tool"]["coverage"]["run"]["include"]
    mine = [p for p in patterns if re.fullmatch(rf"src/shapechanger/{module}(\.py|/\*)", p)]
    assert any(path.suffix == ".py" for pattern in mine for path in _ROOT.glob(pattern))
