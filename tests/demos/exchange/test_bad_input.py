"""Damaged or unsuitable input is refused in one sentence, or only its intact lines are imported."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from shapechanger.demos.episodes import Step
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.errors import DemosError, OutputError, ShapechangerError, UnknownName
from shapechanger.layout import Layout
from tests.demos.exchange.small import (
    all_of,
    content_of,
    drive,
    findings_of,
    header,
    huge,
    keys_folder,
    picture,
    record,
    snapshot,
    tub_folder,
)


def refused(folder: Path, out: Path, format: str = "auto", *, strict: bool = False) -> str:
    """Return the error of a refused import; check that no file was created or changed."""
    before = snapshot(folder) if folder.is_dir() else {}
    neighbours = sorted(out.parent.iterdir())
    with pytest.raises(ShapechangerError) as caught:
        import_recording(folder, out, format, strict=strict)
    assert sorted(out.parent.iterdir()) == neighbours
    assert (snapshot(folder) if folder.is_dir() else {}) == before
    text = str(caught.value)
    assert "\n" not in text
    assert text.endswith(".")
    return text


def _edit(name: str, change: Callable[[bytes], bytes]) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        path = folder / name
        path.write_bytes(change(path.read_bytes()))

    return edit


def _exported(place: Path, name: str) -> Path:
    drive(place / "recorded")
    export_recording(place / "recorded", place / "out-v0", name)
    return place / "out-v0"


def _swap(name: str, old: bytes, new: bytes) -> Callable[[Path], None]:
    return _edit(name, lambda text: text.replace(old, new))


def _table(old: bytes, new: bytes) -> Callable[[Path], None]:
    return _swap("steps.csv", old, new)


def _link_away(folder: Path) -> None:
    (folder.parent / "outside.jpg").write_bytes(picture(9))
    (folder / "2.jpg").unlink()
    (folder / "2.jpg").symlink_to(folder.parent / "outside.jpg")


FALSE = b"false,false"


@pytest.mark.parametrize(
    ("own", "spoil", "expected"),
    [
        (False, lambda f: (f / "2.jpg").unlink(), "line 3 of keys: an image that cannot be read"),
        (False, _edit("2.jpg", lambda jpeg: huge()), "line 3 of keys: a damaged image"),
        (False, _edit("2.jpg", lambda jpeg: jpeg + bytes(17 << 20)), "bytes, more than the limit"),
        (False, _table(b"0.0,0.0,0.0,1.0", b"0.0,0.0,x,1.0"), "line 3 of keys: it is invalid"),
        (False, _table(b"0.0,0.0,0.0,1.0", b"0.0,nan,0.0,1.0"), "line 3 of keys: its action is"),
        (False, _table(b"0.0,0.0,0.0,1.0", b"0.0,0.0,,1.0"), "its action has 3 values"),
        (False, _table(b"\n2.jpg", b"\n../2.jpg"), "leaves the folder"),
        (False, _table(b"\n3.jpg", b"\n1.jpg"), "returns to the image '1.jpg'"),
        (False, _table(b"1499144070.2", b"soon"), "captured_ns is not a time: 'soon'"),
        (False, _link_away, "leaves the folder"),
        (True, _table(b"000001.jpg", b"../1.jpg"), "leaves the folder"),
        (True, _table(FALSE + b",,,\n4", b"maybe,false,,,\n4"), "`bool`, got `str`"),
        (True, _table(b"\n3,", b"\n2,"), "step 2 is not after the step before"),
        (True, _table(b"\n3,", b"\n3,x\n3.5,"), "2 cells instead of"),
        (True, _edit("frames/000002.jpg", lambda jpeg: picture(0, 8, 8)), "8 x 8 pixels instead"),
    ],
)
def test_damaged_lines_of_csv(
    tmp_path: Path, own: bool, spoil: Callable[[Path], object], expected: str
) -> None:
    """Lines damaged by a spreadsheet or an incomplete copy are reported, the others imported."""
    folder = _exported(tmp_path, "csv") if own else keys_folder(tmp_path / "keys")
    spoil(folder)
    assert expected in refused(folder, tmp_path / "data", strict=True)
    done = import_recording(folder, tmp_path / "data")
    assert expected in findings_of(done)
    assert done.steps == (4 if own else 2)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: b"\xef\xbb\xbf" + t,
        lambda t: t.replace(b"\n", b"\r\n"),
        lambda t: t.replace(b"\n", b"\n\n") + b",,,,,,\r\n  \n",
        lambda t: t.replace(b",", b";"),
    ],
)
def test_csv_of_spreadsheets(tmp_path: Path, change: Callable[[bytes], bytes]) -> None:
    """Semicolons, blank lines and byte order marks of spreadsheets do not change numbers."""
    folder = _exported(tmp_path, "csv")
    _edit("steps.csv", change)(folder)
    assert import_recording(folder, tmp_path / "back", strict=True).steps == 5
    (before,), (after,) = all_of(tmp_path / "recorded"), all_of(tmp_path / "back")
    assert content_of(after)["steps"] == content_of(before)["steps"]


def _in_file(change: Callable[[h5py.File], None]) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        with h5py.File(folder / "data/main_data.hdf5", "a") as file:
            change(file)

    return spoil


def _leads_away(file: h5py.File) -> None:
    del file["episode_0/actions"]
    file["episode_0/actions"] = h5py.ExternalLink("other.hdf5", "x")


def _frameless(file: h5py.File) -> None:
    del file["episode_0/infos/frame"]
    file["episode_0/infos/frame"] = ["x"] * 5


def _spoilt(file: h5py.File) -> None:
    file["episode_0/observations/image"][1] = np.frombuffer(picture(1)[:-200], np.uint8)


def _with_rest(text: str) -> Callable[[Path], None]:
    """Return a change of `infos/step` of the first step: the fields that have no column."""
    return _in_file(lambda file: file["episode_0/infos/step"].__setitem__(0, text))


@pytest.mark.parametrize(
    ("form", "spoil", "expected"),
    [
        ("keys", _table(b"file", b"\xff"), "is not text in UTF-8"),
        ("keys", _edit("steps.csv", lambda t: b""), "has neither a header.json nor a column"),
        ("keys", _edit("steps.csv", lambda t: t.splitlines(True)[0]), "There is nothing to import"),
        ("keys", _edit("steps.csv", lambda t: t + b'"open'), "is not valid CSV"),
        ("keys", _table(b"backward", b"forward"), "two columns of one name"),
        ("csv", _edit("header.json", lambda t: t[:40]), "not valid JSON"),
        ("csv", _swap("header.json", b'"format": 1', b'"format": 9'), "format 9"),
        ("csv", _swap("header.json", b'"unit"', b'"u"'), "missing required field `unit`"),
        ("csv", _edit("header.json", lambda t: re.sub(rb"\[\s+40,\s+32\s+]", b"null", t)), "image"),
        ("csv", _table(b"action/steering", b"steer"), "action/steering, steer"),
        ("csv", _table(b"terminated,truncated", b"truncated,terminated"), "their order"),
        ("csv", _table(b"person", b"persona"), "Invalid enum value 'persona'"),
        *(
            ("minari", _with_rest(text), "infos/step of step 0 of episode_0 is damaged: ")
            for text in ("{", "7", "{}", "[" * 10**5, '{"step": {}, "marks": [], "dropped": null}')
        ),
        ("minari", lambda f: (f / "data/main_data.hdf5").unlink(), "names: restore it"),
        ("minari", _edit("data/main_data.hdf5", lambda b: b[:3000]), "is not an intact HDF5 file"),
        ("minari", _edit("data/metadata.json", lambda b: b[:3000]), "not valid JSON"),
        ("minari", _swap("data/metadata.json", b'"hdf5"', b'"arrow"'), "'arrow'"),
        ("minari", _in_file(_frameless), "infos/step of step 0 of episode_0 is damaged: "),
        ("minari", _in_file(_leads_away), "has no 'actions' that is an array in this file"),
        ("minari", _swap("data/main_data.hdf5", b"SNOD", b"XXXX"), "not an intact"),
        ("minari", _in_file(_spoilt), "a damaged image"),
    ],
)
def test_a_dataset_that_cannot_be_read(
    tmp_path: Path, form: str, spoil: Callable[[Path], object], expected: str
) -> None:
    keys = form == "keys"
    folder = keys_folder(tmp_path / form) if keys else _exported(tmp_path, form)
    spoil(folder)
    assert expected in refused(folder, tmp_path / "data", strict=form == "minari")


def test_folders_of_unknown_format(tmp_path: Path) -> None:
    """Empty, missing and ambiguous folders, files, and recordings each have an error."""
    out = tmp_path / "data"
    (tmp_path / "empty").mkdir()
    assert "cannot be imported: expected" in refused(tmp_path / "empty", out)
    (tmp_path / "file").write_text("x")
    assert "is a file: give its folder" in refused(tmp_path / "file", out)
    assert "does not exist" in refused(tmp_path / "gone", out)
    drive(tmp_path / "mine")
    assert "is a recording already" in refused(tmp_path / "mine", out)
    tub = tub_folder(tmp_path / "above/tub", [{"user/angle": 0.0, "user/throttle": 0.5}])
    (tub / "steps.csv").write_text("steering\n0\n")
    assert "looks like tub and csv" in refused(tub, out)
    assert import_recording(tub, out, "csv").steps == 1


def test_the_nearest_format_is_suggested(tmp_path: Path) -> None:
    keys_folder(tmp_path / "keys")
    assert "Did you mean 'minari'" in refused(tmp_path / "keys", tmp_path / "data", "minary")
    assert "is not tub" in refused(tmp_path / "keys", tmp_path / "data", "tub")
    with pytest.raises(UnknownName, match="Did you mean 'csv'"):
        export_recording(drive(tmp_path / "recorded"), tmp_path / "out", "cvs")


def test_invalid_outputs(tmp_path: Path) -> None:
    """Existing paths, paths inside the source, and names that Minari cannot load are refused."""
    folder = keys_folder(tmp_path / "keys")
    (tmp_path / "there").mkdir()
    assert "exists already" in refused(folder, tmp_path / "there")
    assert "lies in" in refused(folder, folder / "data")
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    assert "exists already" in refused(folder, tmp_path / "dangling")
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="Cannot write"):
        import_recording(folder, tmp_path / "file/data")
    drive(tmp_path / "data")
    with pytest.raises(DemosError, match=r"call it .*drive-v0"):
        export_recording(tmp_path / "data", tmp_path / "drive", "minari")
    assert not (tmp_path / "drive").exists()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"control_hz": 10.0}, "in its control_hz: export each kind to its own Minari"),
        ({"image_size": (80, 60)}, "in its image_size"),
    ],
)
def test_episodes_of_two_kinds(tmp_path: Path, changes: dict[str, object], expected: str) -> None:
    drive(tmp_path / "data")
    drive(tmp_path / "data", **changes)
    with pytest.raises(DemosError, match=expected):
        export_recording(tmp_path / "data", tmp_path / "out-v0", "minari")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.mark.parametrize(
    ("jpeg", "expected"),
    [
        (huge(), "claims 60000 x 60000"),
        (picture(1, 48, 32), "48 x 32 pixels instead of 40 x 32"),
        (picture(1, grey=True), "cannot mix grey and coloured images: image of step 1"),
    ],
)
def test_frames_that_minari_cannot_read(tmp_path: Path, jpeg: bytes, expected: str) -> None:
    step = Step(action=(0.0, 0.0), driver="person", state=(0.0, 0.0))
    record(tmp_path / "data", header(), [(step, picture(0)), (step, jpeg)])
    with pytest.raises(DemosError, match=expected):
        export_recording(tmp_path / "data", tmp_path / "out-v0", "minari")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


def test_exports_without_steps_or_with_unknown_options_are_refused(tmp_path: Path) -> None:
    record(tmp_path / "data", header(), [])
    with pytest.raises(DemosError, match="nothing to export"):
        export_recording(tmp_path / "data", tmp_path / "csv", "csv")
    bare = header(image_size=None, state_layout=Layout(()))
    record(tmp_path / "bare", bare, [(Step(action=(0.0, 0.0), driver="person"), None)])
    with pytest.raises(DemosError, match="neither images nor a state"):
        export_recording(tmp_path / "bare", tmp_path / "out-v0", "minari")
    with pytest.raises(DemosError, match="no option 'dropped'"):
        export_recording(tmp_path / "bare", tmp_path / "out", "tub", dropped=True)
    with pytest.raises(DemosError, match="csv has no option 'images', unlike lerobot"):
        export_recording(tmp_path / "bare", tmp_path / "out", "csv", images=True)


def test_texts_are_not_formulas(tmp_path: Path) -> None:
    steps = [
        (Step(action=(0.0, 0.0), driver="person", state=(0.0, 0.0), stop_reason=text), picture(0))
        for text in ("=1+1", "+1", "-1", "@x", "\t=1", "\r=1")
    ]
    record(tmp_path / "data", header(), steps)
    export_recording(tmp_path / "data", tmp_path / "csv", "csv")
    with (tmp_path / "csv/steps.csv").open(newline="") as file:
        reasons = [row["stop_reason"] for row in csv.DictReader(file)]
    assert [json.loads(reason) for reason in reasons] == [s.stop_reason for s, _ in steps]
    assert {reason[0] for reason in reasons} == {'"'}
