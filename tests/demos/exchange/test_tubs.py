"""Donkeycar tubs: numbers and times are read, and incomplete parts are reported."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shapechanger.demos.exchange import Converted, import_recording
from shapechanger.demos.exchange.base import measured_hz
from shapechanger.errors import DemosError, UnknownName
from tests.demos.exchange.small import all_of, findings_of, picture, tub_folder

T0_MS = 1_700_000_000_000
NO_IMAGE: dict[str, Any] = {"cam/image_array": None}


def records(
    count: int, first: int = 0, period_ms: float = 50.0, **more: Any
) -> list[dict[str, Any]]:
    """Return records whose steering is a hundredth of their `_index`."""
    return [
        {
            "_index": first + n,
            "_timestamp_ms": T0_MS + round(n * period_ms),
            "user/angle": (first + n) / 100,
            "user/throttle": 0.5,
        }
        | more
        for n in range(count)
    ]


def imported(folder: Path, **options: Any) -> tuple[list[list[int]], Converted]:
    """Import a tub; return the record numbers of each episode, found from the steering."""
    out = folder.with_name(f"{folder.name}-data-{len(list(folder.parent.iterdir()))}")
    done = import_recording(folder, out, **options)
    return [[round(s.action[0] * 100) for s in e.steps] for e in all_of(out)], done


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 50), st.integers(2, 12), st.data(), st.integers(1, 6))
def test_deletions_refer_to_the_index(
    tmp_path_factory: pytest.TempPathFactory,
    first: int,
    count: int,
    chosen: st.DataObject,
    per_catalog: int,
) -> None:
    """The tub begins at any index, as if earlier catalogs were removed."""
    kept = chosen.draw(st.integers(first, first + count - 1))
    indexes = st.integers(first, first + count - 1)
    deleted = chosen.draw(st.sets(indexes.filter(lambda n: n != kept)))
    folder = tub_folder(
        tmp_path_factory.mktemp("tub") / "tub",
        records(count, first, **NO_IMAGE),
        sorted(deleted),
        per_catalog=per_catalog,
    )
    episodes, done = imported(folder)
    assert episodes == [[n for n in range(first, first + count) if n not in deleted]]
    assert "left out" not in findings_of(done)


def test_a_tub_of_version_1(tmp_path: Path) -> None:
    """Deletions refer to numbers of records, and a restart of the car begins an episode."""
    folder = tmp_path / "tub"
    folder.mkdir()
    for n in range(3, 15):
        (folder / f"{n}_cam.jpg").write_bytes(picture(n))
        fields = {"cam/image_array": f"{n}_cam.jpg", "user/angle": n / 100, "user/throttle": 0.5}
        fields["milliseconds"] = 50 * (n - 3 if n < 13 else n - 13)
        (folder / f"record_{n}.json").write_text(json.dumps(fields))
    (folder / "meta.json").write_text(json.dumps({"inputs": [], "types": []}))
    (folder / "exclude.json").write_text("[5, 6, 40]")
    episodes, done = imported(folder)
    assert episodes == [[3, 4, *range(7, 13)], [13, 14]]
    assert "Records that are deleted in the tub are not imported: 2." in findings_of(done)
    first, _ = all_of(next(path for path in tmp_path.iterdir() if path != folder))
    assert first.header.control_hz == pytest.approx(20.0)
    assert {step.wall_ns for step in first.steps} == {None}  # Times are relative to the start.
    (folder / "exclude.json").write_text('{"5": true}')
    with pytest.raises(DemosError, match=r"exclude.json is damaged: Expected `array`"):
        imported(folder)


def lines(change: Callable[[list[bytes]], list[bytes]]) -> Callable[[Path], object]:
    def spoil(folder: Path) -> None:
        path = folder / "catalog_0.catalog"
        path.write_bytes(b"".join(change(path.read_bytes().splitlines(True))))

    return spoil


def fields(**changes: Any) -> Callable[[Path], object]:
    """Return a change of fields of the records 0 and 4; fields that become None are removed."""

    def change(line: bytes) -> bytes:
        plain = json.loads(line)
        if plain["_index"] in {0, 4}:
            plain = {k: v for k, v in (plain | changes).items() if v is not None}
        return json.dumps(plain).encode() + b"\n"

    return lines(lambda found: list(map(change, found)))


def field(name: str, value: Any) -> Callable[[Path], object]:
    return fields(**{name: value})


def in_manifest(old: str, new: str) -> Callable[[Path], object]:
    def spoil(folder: Path) -> None:
        path = folder / "manifest.json"
        path.write_text(path.read_text().replace(old, new))

    return spoil


@pytest.mark.parametrize(
    ("spoil", "expected", "lost"),
    [
        (
            lambda f: (f / "images/3_cam_image_array_.jpg").unlink(),
            "record 3: an image that cannot be read (No such file or directory)",
            {3},
        ),
        (
            lambda f: (f / "images/0_cam_image_array_.jpg").write_bytes(picture(0, 80, 32)),
            "record 0: an image of 80 x 32 pixels instead of 40 x 32",
            {0},
        ),
        (lines(lambda ls: [*ls, bytes(512)]), "line 7: damaged JSON", set()),
        (lines(lambda ls: [*ls[:-1], ls[-1][:-9]]), "catalog_0.catalog, line 6", {5}),
        (lines(lambda ls: [*ls, ls[4]]), "record 4: the _index of several records", {4}),
        (field("_index", "x"), "line 5: damaged JSON, or no valid _index", {0, 4}),
        (field("user/angle", 1.5), "(Expected `float` <= 1.0 - at `$.user/angle`)", {0, 4}),
        (field("pilot/angle", math.nan), "invalid value (Expected `float` >= -1.0", {0, 4}),
        (field("_timestamp_ms", "soon"), "got `str` - at `$._timestamp_ms`)", {0, 4}),
        (field("user/throttle", None), "record 0, record 4: no action in the mode 'user'", {0, 4}),
        (field("user/mode", "local"), "no action in the mode 'local'", {0, 4}),
        (field("cam/image_array", None), "record 0, record 4: no image", {0, 4}),
        (field("cam/image_array", "a\0b.jpg"), "an image name that leaves the folder", {0, 4}),
        (
            field("cam/image_array", "1_cam_image_array_.jpg"),
            "record 0, record 1, record 4: the image of several records",
            {0, 1, 4},
        ),
        (lambda f: (f / "catalog_1.catalog").unlink(), "1.catalog: There is no", {6, 7, 8, 9}),
        (in_manifest("catalog_1", "../catalog_1"), "leaves the folder", {6, 7, 8, 9}),
    ],
)
def test_the_rest_of_a_damaged_tub_is_imported(
    tmp_path: Path, spoil: Callable[[Path], object], expected: str, lost: set[int]
) -> None:
    folder = tub_folder(tmp_path / "tub", records(10), per_catalog=6)
    spoil(folder)
    with pytest.raises(DemosError, match="is incomplete"):
        imported(folder, strict=True)
    episodes, done = imported(folder)
    assert [n for episode in episodes for n in episode] == [n for n in range(10) if n not in lost]
    assert expected in findings_of(done)


def test_catalogs_in_another_order(tmp_path: Path) -> None:
    folder = tub_folder(tmp_path / "tub", records(6))
    in_manifest('"catalog_0.catalog", "catalog_1.', '"catalog_1.catalog", "catalog_0.')(folder)
    in_manifest('"current_index": 6', '"current_index": 9')(folder)
    in_manifest('"deleted_indexes": []', '"deleted_indexes": [2, 8, 9]')(folder)
    episodes, done = imported(folder)
    assert episodes == [[0, 1, 3, 4, 5]]
    assert findings_of(done).splitlines()[:3] == [
        "warning: The _index does not always rise: the records are read in its order.",
        "note: 3 of the records 0 to 8 are in no catalog.",
        "warning: 1 of the deleted indexes belong to no record: 9.",
    ]


def test_pictures_of_other_records(tmp_path: Path) -> None:
    """A warning lists records whose image has another number in its name."""
    made = records(6)
    for record in made:
        record["cam/image_array"] = f"{record['_index'] + 2}_cam_image_array_.jpg"
    folder = tub_folder(tmp_path / "tub", made)
    for n in range(8):
        (folder / f"images/{n}_cam_image_array_.jpg").write_bytes(picture(n))
    _, done = imported(folder)
    assert "... (6 in all): the image of another number" in findings_of(done)


@pytest.mark.parametrize("lines", [0, 4])
def test_a_damaged_manifest(tmp_path: Path, lines: int) -> None:
    """A manifest that was cut off is refused, because it lists the deleted records."""
    folder = tub_folder(tmp_path / "tub", records(6), [0])
    manifest = folder / "manifest.json"
    manifest.write_bytes(b"".join(manifest.read_bytes().splitlines(True)[:lines]) + bytes(99))
    with pytest.raises(DemosError, match=r"manifest.json is damaged"):
        imported(folder)


@pytest.mark.parametrize(
    ("period_ms", "stated", "hz", "rate", "finding"),
    [
        (50.0, None, None, 20.0, ""),
        (51.0, None, None, 20.0, "19.61 a second"),
        (33.34, None, None, 30.0, ""),
        (100.9, None, None, 10.0, "9.911 a second"),
        (52.0, "19.2", None, 19.2, ""),
        (52.0, 20, None, 20.0, ""),
        (52.0, "soon", None, 19.23, ""),
        (52.0, "50", None, 50.0, "19.23 a second, not at 50 Hz: their times are left out"),
        (3.0, None, None, 333.0, "unlike those of robots: --hz sets the rate"),
        (3.0, None, 20.0, 20.0, "3 ms apart"),
    ],
)
def test_rates_by_times(
    tmp_path: Path, period_ms: float, stated: object, hz: float | None, rate: float, finding: str
) -> None:
    """Rates are right within 0.2 %; times that contradict a stated rate are left out."""
    made = records(60, period_ms=period_ms, **NO_IMAGE)
    folder = tub_folder(tmp_path / "tub", made, range(20, 30))
    if stated is not None:
        manifest = (folder / "manifest.json").read_text().splitlines()
        manifest[2] = json.dumps({"DRIVE_LOOP_HZ": stated})
        (folder / "manifest.json").write_text("\n".join(manifest))
    _, done = imported(folder, hz=hz)
    (episode,) = all_of(next(p for p in tmp_path.iterdir() if p != folder))
    assert episode.header.control_hz == pytest.approx(rate, rel=2e-3)
    assert finding in findings_of(done)
    if "their times are left out" in findings_of(done):
        assert {step.clock_ns for step in episode.steps} == {None}
        assert episode.header.created == ""
    else:  # The duration includes the ten deleted records.
        assert episode.seconds == pytest.approx(60 * period_ms / 1e3, rel=0.01)
        assert episode.header.created == "2023-11-14T22:13:20.000+00:00"


@given(st.lists(st.floats(0.0, 1e12), min_size=1, max_size=30))
def test_a_measured_rate_is_within_the_periods(periods_ns: list[float]) -> None:
    hz = measured_hz(periods_ns)
    positive = [period for period in periods_ns if period > 0.0]
    if not positive:
        assert hz is None
        return
    assert hz is not None
    zeros = len(periods_ns) / len(positive)  # Ratio of all periods, with zeros of a coarse clock.
    assert 1e9 / max(positive) * (1 - 1e-9) <= hz <= 1e9 / min(positive) * zeros * (1 + 1e-9)


def test_periods_of_two_kinds() -> None:
    """The rate follows from the prevailing period; if no period prevails, from the mean."""
    assert measured_hz([50e6, 430e6] * 50) == pytest.approx(1 / 0.24)
    assert measured_hz([50e6] * 60 + [430e6] * 40) == pytest.approx(20.0)


def test_times_that_jump(tmp_path: Path) -> None:
    """A new episode begins, with a report, after a pause and where the clock was set back."""
    made = records(30)
    for record in made[10:]:
        record["_timestamp_ms"] += 120_000
    for record in made[20:]:
        record["_timestamp_ms"] -= 3_600_000
    session = {"_session_id": "s", "cam/image_array": None}
    episodes, done = imported(tub_folder(tmp_path / "tub", [r | session for r in made]))
    assert episodes == [[*range(10)], [*range(10, 20)], [*range(20, 30)]]
    assert "note: record 10: an episode begins after a pause" in findings_of(done)
    assert "warning: record 20: time runs backwards" in findings_of(done)


def test_sessions_at_different_rates(tmp_path: Path) -> None:
    made = records(24, **NO_IMAGE)
    for n, record in enumerate(made):
        record |= {"_session_id": n // 12, "_timestamp_ms": T0_MS + n * (50 if n < 12 else 100)}
    folder = tub_folder(tmp_path / "tub", made)
    text = findings_of(imported(folder)[1])
    assert text == "warning: The drives have from 10 to 20 steps a second."
    lost = [r if n else {k: v for k, v in r.items() if k[0] != "_"} for n, r in enumerate(made)]
    first = {"_session_id": 0, "_index": 0}
    episodes, done = imported(tub_folder(tmp_path / "lost", [lost[0] | first, *lost[1:]]))
    assert "warning: record 0: some records lack a time" in findings_of(done)
    assert episodes == [[*range(12)], [*range(12, 24)]]
    with pytest.raises(DemosError, match="--hz must be positive"):
        imported(folder, hz=-1.0)


def test_cameras_of_other_names(tmp_path: Path) -> None:
    """A single camera of any name is imported; several cameras require a choice."""
    names = {"cam/left": "{}_left.jpg", "cam/right": "{}_right.jpg"}
    for count in (1, 2):
        cameras = list(names)[:count]
        made = records(3, **NO_IMAGE)
        for record in made:
            record |= {name: names[name].format(record["_index"]) for name in cameras}
        inputs = dict.fromkeys(cameras, "image_array")
        folder = tub_folder(tmp_path / f"tub{count}", made, inputs=inputs)
        for n in range(3):
            (folder / f"images/{n}_left.jpg").write_bytes(picture(n))
            (folder / f"images/{n}_right.jpg").write_bytes(picture(9, 48, 32))
        if count == 1:
            assert imported(folder)[1].pictures == 3
    with pytest.raises(DemosError, match=r"2 cameras: choose one of cam/left, cam/right by"):
        imported(folder)
    _, done = imported(folder, camera="cam/right")
    assert done.pictures == 3
    assert findings_of(done) == "note: Columns that are not imported: cam/left."
    with pytest.raises(UnknownName, match="Did you mean 'cam/left'"):
        imported(folder, camera="cam/lefty")


def test_depth_and_lists_are_named(tmp_path: Path) -> None:
    inputs = {"cam/depth_array": "gray16_array", "lidar": "nparray", "imu/gyr_z": "float"}
    extra = {"cam/depth_array": "d.png", "lidar": [0.5], "imu/gyr_z": 2.5, "gear": "low"}
    made = [r | extra for r in records(3)]
    _, done = imported(tub_folder(tmp_path / "tub", made, inputs=inputs))
    assert "not imported: cam/depth_array, lidar, gear." in findings_of(done)
    _, done = imported(tub_folder(tmp_path / "deep", [r | NO_IMAGE for r in made], inputs=inputs))
    assert "warning: The steps have no images, because images of 16 bits" in findings_of(done)


def test_unknown_times_and_starts(tmp_path: Path) -> None:
    """If a record lacks a time, all are left out; without times, rate and start are unknown."""
    made = records(4, **NO_IMAGE)
    made[2]["_timestamp_ms"] = None
    _, done = imported(tub_folder(tmp_path / "tub", made))
    assert "record 0: some records lack a time" in findings_of(done)
    for record in made:
        del record["_timestamp_ms"]
    folder = tub_folder(tmp_path / "none", made)
    _, done = imported(folder)
    assert findings_of(done).startswith("note: The rate is unknown: 20 Hz are assumed;")
    (episode,) = all_of(next(p for p in tmp_path.iterdir() if p.name.startswith("none-data")))
    assert episode.header.created == ""
