"""Examples and links of the documentation."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import pytest

from shapechanger.contract.env_ref import layouts_of
from shapechanger.envs.catalogue import env_ref
from shapechanger.transfer import study
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.plan import Plan

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(page: Path, language: str) -> list[str]:
    """Return the code blocks of a page."""
    return re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_examples_run(page: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The Python blocks of a page run, one after another."""
    # A study takes hours: only plan it.
    planned: list[Plan] = []
    monkeypatch.setattr(study, "run_study", lambda plan, out: planned.append(plan))
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), names)
    assert bool(planned) == (page.stem == "studies")


@pytest.mark.sources
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_blocks(page: Path) -> None:
    """Links lead to files; blocks inside lists are indented by four spaces, as MkDocs needs."""
    text = re.sub(r"<!-- .*? -->", "", page.read_text(), flags=re.DOTALL)  # Without comments.
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (page.parent / target).exists(), target
    fences = re.findall(r"^( +)```", text, re.MULTILINE)
    assert {len(spaces) % 4 for spaces in fences} <= {0}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_names_of_modules_and_functions_exist(page: Path) -> None:
    names = set(re.findall(r"`(shapechanger(?:\.(?!json\b)\w+)+)", page.read_text()))
    groups = {"shapechanger.methods", "shapechanger.learners"}  # Of entry points.
    for name in names - groups:
        module, found = name, None
        while found is None:
            try:
                found = importlib.import_module(module)
            except ModuleNotFoundError:
                module = module.rpartition(".")[0]
        for part in name[len(module) :].split(".")[1:]:
            found = getattr(found, part)


def test_the_map_of_the_guide_is_valid() -> None:
    (text,) = blocks(ROOT / "docs" / "body-maps.md", "toml")
    source, target = (env_ref(name).make() for name in ("Ant", "ExtendedAnt"))
    (so, sa), (to, ta) = layouts_of(source), layouts_of(target)
    crossing = BodyMap.from_toml(text, so, to, sa, ta)
    rules = {row.entry: row.rule for row in crossing.table() if row.side == "action"}
    assert "ankle_4" in rules["foot_1/motor"]
