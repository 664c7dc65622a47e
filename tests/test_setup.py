"""Consistency of pyproject.toml and constraints.txt."""

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
    lines = (_ROOT / "constraints.txt").read_text().splitlines()
    pins = [line.split("==") for line in lines if line and not line.startswith("#")]
    return {canonicalize_name(name): version for name, version in pins}


def _requirements() -> Iterator[tuple[str, Requirement]]:
    """Yield each external requirement with the name of its group."""
    groups = {"dependencies": _PYPROJECT["project"]["dependencies"], **_EXTRAS}
    for group, lines in groups.items():
        for requirement in map(Requirement, lines):
            if requirement.name != "shapechanger":
                yield group, requirement


def test_every_requirement_is_pinned_inside_its_range() -> None:
    pins = _pins()
    outside = [
        f"{group}: {requirement}, pinned {pins.get(canonicalize_name(requirement.name))}"
        for group, requirement in _requirements()
        if not requirement.specifier.contains(pins.get(canonicalize_name(requirement.name), "0"))
    ]
    assert outside == []


def test_pins_fit_every_platform() -> None:
    """No pin has a local version such as torch's +cpu, which only some platforms have."""
    assert {name: v for name, v in _pins().items() if Version(v).local is not None} == {}


def test_all_is_the_sum_of_the_extras_for_users() -> None:
    """`all` has every extra except `dev`, the 0.4 GB of `gpu`, and `ray`, which needs a cluster."""
    (everything,) = map(Requirement, _EXTRAS["all"])
    assert everything.extras == set(_EXTRAS) - {"all", "dev", "gpu", "ray"}


@pytest.mark.sources
def test_settings_of_tools_find_their_files() -> None:
    """Every pattern of the settings of coverage and of mutmut matches a file."""
    tools = _PYPROJECT["tool"]
    mutmut: dict[str, list[str]] = tools["mutmut"]
    ignored = [one.removeprefix("--ignore=") for one in mutmut["pytest_add_cli_args"] if "/" in one]
    patterns: list[str] = [
        *tools["coverage"]["run"]["include"],
        *mutmut["only_mutate"],
        *mutmut["pytest_add_cli_args_test_selection"],
        *ignored,
    ]
    assert [pattern for pattern in patterns if not list(_ROOT.glob(pattern))] == []


def test_this_tree_names_one_version() -> None:
    """CITATION.cff has the version of pyproject.toml, and CHANGELOG.md begins with it."""
    version = _PYPROJECT["project"]["version"]
    assert f"\nversion: {version}\n" in (_ROOT / "CITATION.cff").read_text()
    headings = re.findall(r"^## (\S+) \(", (_ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert headings[0] == version


def test_fragments_of_the_changelog_have_a_kind() -> None:
    """A fragment of another kind would not be published in the changelog."""
    kinds = {one["directory"] for one in _PYPROJECT["tool"]["towncrier"]["type"]}
    names = [file.name for file in (_ROOT / "changelog.d").glob("*.*.md")]
    assert [name for name in names if name.split(".")[-2] not in kinds] == []
