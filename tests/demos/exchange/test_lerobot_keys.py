"""Steps and images of LeRobot datasets are found by index and time, never by counting."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shapechanger.demos.exchange import import_recording
from shapechanger.errors import DemosError
from tests.demos.exchange.lerobot_set import (
    CAMERA,
    DATA,
    EPISODES,
    VIDEO,
    pairs_of,
    write_set,
    write_video,
)
from tests.demos.exchange.small import all_of

BOTH = [[(n, n) for n in range(8)], [(n, n) for n in range(8, 16)]]


def without(*steps: int) -> list[list[tuple[int, int]]]:
    """Return the pairs of both episodes, except those of some steps."""
    return [[pair for pair in episode if pair[0] not in steps] for episode in BOTH]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, BOTH),
        ({"options": ["-bf", "3", "-g", "12"]}, BOTH),
        # An image is lost, and its time with it.
        ({"options": ["-vf", "select=not(eq(n\\,5))", "-fps_mode", "vfr"]}, without(5)),
        ({"options": ["-vf", "select=not(eq(n\\,8))", "-fps_mode", "vfr"]}, without(8)),
        # More images than steps.
        ({"fps": 10, "video_fps": 30, "pictures": [n // 3 for n in range(48)]}, BOTH),
        # A video that begins later, as its entries say.
        (
            {
                "options": ["-output_ts_offset", "0.5"],
                "places": lambda entries: [
                    entry
                    | {
                        f"videos/{CAMERA}/{key}": entry[f"videos/{CAMERA}/{key}"] + 0.5
                        for key in ("from_timestamp", "to_timestamp")
                    }
                    for entry in entries
                ],
            },
            BOTH,
        ),
        # One image.
        ({"lengths": (1,)}, [[(0, 0)]]),
        # Times in milliseconds.
        ({"fps": 30, "options": ["-video_track_timescale", "1000"]}, BOTH),
    ],
)
def test_pictures_are_found_by_their_time(
    tmp_path: Path, options: dict[str, Any], expected: list[list[tuple[int, int]]]
) -> None:
    pairs, context = pairs_of(write_set(tmp_path / "set", **options))
    assert pairs == expected
    lost = sum(options.get("lengths", (8, 8))) - sum(map(len, expected))
    assert sum(map(len, context.left_out.values())) == lost
    assert not context.warnings


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    lost=st.sets(st.integers(0, 15), max_size=6),
    rate=st.sampled_from([1, 2, 3]),
    key=st.sampled_from([1, 5, 250]),
)
def test_no_lost_picture_shifts_the_others(
    tmp_path_factory: pytest.TempPathFactory, lost: set[int], rate: int, key: int
) -> None:
    numbers = [n // rate for n in range(16 * rate)]
    gone = "+".join(f"eq(n\\,{n * rate})" for n in lost) or "0"
    folder = write_set(
        tmp_path_factory.mktemp("lost") / "set",
        fps=10,
        video_fps=10 * rate,
        pictures=numbers,
        options=["-vf", f"select=not({gone})", "-fps_mode", "vfr", "-g", f"{key}", "-bf", "2"],
    )
    pairs, context = pairs_of(folder)
    assert all(step == picture for episode in pairs for step, picture in episode)
    left = {what: len(found) for (what, _), found in context.left_out.items()}
    if "episode" not in left:
        assert sum(map(len, pairs)) == 16 - len(lost)


def place(number: int, **changes: Any) -> Any:
    """Return a change of the entry of an episode; a key without "/" is of its video."""

    def change(entries: list[dict[str, Any]]) -> None:
        for key, value in changes.items():
            short = key.endswith("timestamp") or key == "video"
            entries[number][f"videos/{CAMERA}/{key}" if short else key] = value

    return change


def row(number: int, **changes: Any) -> Any:
    """Return a change of a row."""
    return lambda rows: rows[number].update(changes)


def every(change: Any) -> Any:
    """Return a change of all rows, by a function of a row."""
    return lambda rows: [entry | change(entry) for entry in rows]


@pytest.mark.parametrize(
    ("options", "episodes", "reason"),
    [
        # The video.
        ({"options": ["-use_editlist", "0", "-bf", "2"]}, [], r"begins 0\.1 s later"),
        ({"options": ["-output_ts_offset", "0.5"]}, [], r"begins 0\.5 s later"),
        # Images after a lost one moved up, and nothing says which one is lost.
        ({"pictures": [*range(5), *range(6, 16)]}, [], r"ends 0\.05 s before its last step"),
        ({"places": place(0, to_timestamp=0.35)}, [1], "fewer images than steps"),
        ({"places": place(1, from_timestamp=0.35)}, [], r"overlaps.*0 \(0\.05 s\), 1"),
        (
            {"places": place(1, from_timestamp=0.42, to_timestamp=0.82)},
            [0],
            "of most steps.*0.02 s",
        ),
        ({"video_fps": 10, "pictures": range(8)}, [], "of most steps"),
        ({"video_fps": 25, "pictures": range(20)}, [], "of most steps"),
        # The keys.
        ({"rows": row(3, frame_index=4)}, [1], r"is there twice: 0 \(4\)"),
        ({"rows": row(3, frame_index=9)}, [1], "another length.*up to 9, and a length of 8"),
        ({"rows": row(9, index=40)}, [0], r"not dataset_from_index \+ frame_index: 1 \(off by"),
        ({"rows": every(lambda r: {"index": r["frame_index"]})}, [0], "off by up to 8"),
        ({"rows": row(4, timestamp=np.float32(0.1))}, [1], "time runs backwards.*after step 3"),
        ({"rows": every(lambda r: {"timestamp": r["index"] / 20})}, [0], r"not begin at 0.*0\.4 s"),
        (
            {"rows": every(lambda r: {"timestamp": r["frame_index"] / 10})},
            [],
            r"than the 20 Hz of meta/info.json.*10 Hz",
        ),
        ({"rows": row(9, timestamp=None)}, [], "timestamp that is empty"),
        # The entries.
        ({"places": place(0, length=7)}, [1], r"another length.*a length of 7"),
        ({"places": place(0, dataset_to_index=9)}, [1], r"length is not dataset_to_index - .*9\)"),
        (
            {"places": place(1, dataset_from_index=7, dataset_to_index=15)},
            [0],
            "off by up to 1",
        ),
        ({"places": lambda entries: entries[:1]}, [0], "meta/episodes does not have: 1"),
        ({"places": lambda entries: entries[1:]}, [1], "meta/episodes does not have: 0"),
        ({"places": lambda entries: [*entries, entries[0]]}, [1], "has twice: 0"),
        ({"rows": lambda rows: rows[:8]}, [0], "without rows in the data: 1"),
    ],
)
def test_contradictions_are_left_out(
    tmp_path: Path, options: dict[str, Any], episodes: list[int], reason: str
) -> None:
    """An episode whose keys disagree is not imported, and the report states by how much."""
    pairs, context = pairs_of(write_set(tmp_path / "set", **options))
    assert pairs == [BOTH[number] for number in episodes]
    assert re.search(reason, "\n".join(context.left_out_lines())), context.left_out_lines()


@pytest.mark.parametrize(
    ("options", "warning"),
    [
        ({"info": {"total_episodes": 3}}, "total_episodes 3, and meta/episodes 2"),
        ({"info": {"total_frames": 15}}, "total_frames 15, and meta/episodes 16"),
        ({"pictures": range(18)}, r"ends later than its episodes.*by 0\.1 s"),
    ],
)
def test_contradictions_that_change_no_step_are_reported(
    tmp_path: Path, options: dict[str, Any], warning: str
) -> None:
    folder = write_set(tmp_path / "set", **options)
    pairs, context = pairs_of(folder)
    assert pairs == BOTH
    with pytest.raises(DemosError, match=warning):
        context.require_whole(folder)


def test_rows_in_any_order_and_in_several_files(tmp_path: Path) -> None:
    """Rows are sorted by their keys, and found in whichever file they are."""

    def shuffled(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        return random.Random(0).sample(rows, len(rows))

    folder = write_set(tmp_path / "set", rows=shuffled)
    pairs, context = pairs_of(folder)
    assert pairs == BOTH
    assert (context.notes, context.warnings) == (
        ["Rows are not in the order of frame_index: they are sorted by it."],
        [],
    )
    table = pq.read_table(folder / DATA)
    pq.write_table(table.slice(0, 5), folder / DATA)
    pq.write_table(table.slice(5), (folder / DATA).with_name("file-001.parquet"))
    pairs, context = pairs_of(folder)
    assert pairs == BOTH
    assert not context.warnings


def test_a_missing_row_is_a_missing_step(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set", rows=lambda rows: [*rows[:3], *rows[4:]])
    pairs, context = pairs_of(folder)
    assert pairs == without(3)
    assert context.left_out_lines() == ["1 step without a row in the data: 3 of episode 0"]
    import_recording(folder, tmp_path / "back")
    first = all_of(tmp_path / "back")[0]
    assert [step.captured_ns for step in first.steps[2:5]] == [
        100_000_000,
        200_000_000,
        250_000_000,
    ]


def test_irregular_times_are_kept(tmp_path: Path) -> None:
    """A pause in the times is reported; steps and images stay together."""

    def paused(rows: list[dict[str, Any]]) -> None:
        for entry in rows:
            entry["timestamp"] = np.float32(
                entry["frame_index"] / 20 + 0.1 * (entry["frame_index"] > 4)
            )

    folder = write_set(
        tmp_path / "set",
        lengths=(8,),
        rows=paused,
        places=place(0, to_timestamp=0.5),
        options=["-vf", "setpts=PTS+gt(N\\,4)*0.1/TB", "-fps_mode", "vfr"],
    )
    pairs, context = pairs_of(folder)
    assert pairs == BOTH[:1]
    assert "differ from frame_index / fps by up to 0.1 s" in context.warnings[0]


def test_a_video_that_is_cut_off(tmp_path: Path) -> None:
    folder = write_set(
        tmp_path / "set", lengths=(8, 8), options=["-g", "1", "-movflags", "+faststart"]
    )
    content = (folder / VIDEO).read_bytes()
    (folder / VIDEO).write_bytes(content[:-40])
    pairs, context = pairs_of(folder)
    assert pairs == BOTH[:1]
    assert any("cut off" in line for line in context.left_out_lines())


def test_one_damaged_file_of_several(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    entries = pq.read_table(folder / EPISODES).to_pylist()
    second = VIDEO.replace("file-000", "file-001")
    entries[1] |= {f"videos/{CAMERA}/file_index": 1}
    entries[1] |= {f"videos/{CAMERA}/from_timestamp": 0.0, f"videos/{CAMERA}/to_timestamp": 0.4}
    pq.write_table(pa.Table.from_pylist(entries), folder / EPISODES)
    write_video(folder / VIDEO, range(8), 20)
    (folder / second).write_bytes(b"nothing")
    pairs, context = pairs_of(folder)
    assert pairs == BOTH[:1]
    write_video(folder / second, range(8, 16), 20)
    assert pairs_of(folder)[0] == BOTH
    with pytest.raises(DemosError, match=r"video cannot be read.*file-001"):
        context.require_whole(folder)
