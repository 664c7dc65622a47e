"""Which modules count as the user's own, and what their hashes are made of."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.identity import modules_of, named_modules, own_modules


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that modules are imported from."""
    monkeypatch.syspath_prepend(str(tmp_path))
    known = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - known:
        del sys.modules[name]


def _write(folder: Path, **files: str) -> None:
    for name, text in files.items():
        path = folder / (name.replace("__", "/") + ".py")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def test_modules_count_with_all_that_they_import(folder: Path) -> None:
    """In functions, from packages with and without `__init__`, relative, and not yet imported."""
    _write(
        folder,
        om_task="import numpy\nfrom om_pack import tool\ndef f():\n    import om_late\n",
        om_pack__tool="from . import near\nfrom .deep.low import X\nimport shapechanger\n",
        om_pack__near="",
        om_pack__deep__low="X = 1\n",
        om_late="import json\n",
        om_other="",
    )
    (folder / "om_pack" / "deep" / "__init__.py").write_text("from ..near import __doc__\n")
    expected = ["om_late.py", "om_pack/deep/__init__.py", "om_pack/deep/low.py"]
    expected += ["om_pack/near.py", "om_pack/tool.py", "om_task.py"]
    before = own_modules(["om_task"])
    assert list(before) == expected
    importlib.import_module("om_task")
    assert own_modules(["om_task"]) == before


def test_installed_modules_and_ours_do_not_count() -> None:
    """The plan lists versions of installed modules."""
    assert own_modules(["numpy", "json", "shapechanger.layout", "no_such_module", ""]) == {}


def test_modules_that_are_imported_by_other_means_count(folder: Path) -> None:
    """A name that a module has got from another is of that one."""
    _write(
        folder,
        om_dynamic="import importlib\nhelp_ = importlib.import_module('om_hidden').help_\n",
        om_hidden="def help_():\n    pass\n",
    )
    importlib.import_module("om_dynamic")
    assert list(own_modules(["om_dynamic"])) == ["om_dynamic.py", "om_hidden.py"]


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("X = 1\r\n", True),
        ("\ufeffX = 1\n", True),
        ("X = 1\nif __name__ == '__main__':\n    print(X)\n", True),
        ("X = 2\n", False),
        ("X = (\n", False),
    ],
)
def test_only_what_an_import_runs_counts(text: str, same: bool, folder: Path) -> None:
    """Line ends, a mark of the encoding and the part of a script do not."""
    _write(folder, om_one="X = 1\n")
    before = own_modules(["om_one"])
    (folder / "om_one.py").write_bytes(text.encode())
    assert (own_modules(["om_one"]) == before) is same


def test_the_modules_of_an_object_are_those_of_its_class_and_its_bases() -> None:
    """A function, a class and an instance are of the modules that define them."""
    names = modules_of(Path(), test_installed_modules_and_ours_do_not_count, sys)
    assert {"pathlib", __name__, "sys"} <= names


def test_names_in_arguments_name_modules() -> None:
    """`module:Name` does, and texts that only have a colon do not."""
    texts = ["om_a:B", "om.c:d-e", "note: text", '{"edit": 1}', "C:\\x", ":x"]
    assert list(named_modules(texts)) == ["om_a", "om.c"]
