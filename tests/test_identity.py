"""Custom modules and their hashes."""

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
    """Imports inside functions, relative ones, and packages without `__init__` count too."""
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
    """Plans list the versions of installed packages instead."""
    assert own_modules(["numpy", "json", "shapechanger.layout", "no_such_module", ""]) == {}


def test_modules_that_are_imported_by_other_means_count(folder: Path) -> None:
    """The module that defines a function counts if `importlib` imported it."""
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
def test_only_code_that_an_import_runs_counts(text: str, same: bool, folder: Path) -> None:
    """Line ends, a byte-order mark and the block of a script are not hashed."""
    _write(folder, om_one="X = 1\n")
    before = own_modules(["om_one"])
    (folder / "om_one.py").write_bytes(text.encode())
    assert (own_modules(["om_one"]) == before) is same


def test_an_object_belongs_to_the_modules_of_its_class_and_bases() -> None:
    names = modules_of(Path(), test_installed_modules_and_ours_do_not_count, sys)
    assert {"pathlib", __name__, "sys"} <= names


def test_only_texts_like_module_and_name_name_modules() -> None:
    texts = ["om_a:B", "om.c:d-e", "note: text", '{"edit": 1}', "C:\\x", ":x"]
    assert list(named_modules(texts)) == ["om_a", "om.c"]
