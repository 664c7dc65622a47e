"""Steps and images of LeRobot datasets are found by index and time, never by counting."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shapechanger.demos.exchange import video
from tests.demos.exchange.lerobot_set import CAMERA, DATA, SIZE, VIDEO, pairs_of, write_set
from tests.demos.exchange.small import findings_of

BOTH = [[(n, n) for n in range(8)], [(n, n) for n in range(8, 16)]]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({}, BOTH),
        ({"options": ["-bf", "3", "-g", "12"]}, BOTH),
        # More images than steps.
        ({"fps": 10, "video_fps": 30, "pictures": [n // 3 for n in range(48)]}, BOTH),
        # A video that begins later, as `meta/episodes` states.
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
    assert not context.findings


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sets(st.integers(0, 15), max_size=6), st.integers(1, 3), st.sampled_from([1, 5, 250]))
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
    whole = [all(n not in lost for n in range(first, first + 8)) for first in (0, 8)]
    assert len(pairs) <= sum(whole)
    assert len(pairs) == sum(whole) or context.findings


def place(number: int, **changes: Any) -> Any:
    """Return a change of an episode's row in `meta/episodes`; timestamps are the video's."""

    def change(entries: list[dict[str, Any]]) -> None:
        for key, value in changes.items():
            short = key.endswith("timestamp") or key == "video"
            entries[number][f"videos/{CAMERA}/{key}" if short else key] = value

    return change


def row(number: int, **changes: Any) -> Any:
    return lambda rows: rows[number].update(changes)


def every(change: Any) -> Any:
    """Return a change of all rows, by a function of a row."""
    return lambda rows: [entry | change(entry) for entry in rows]


@pytest.mark.parametrize(
    ("options", "episodes", "reason"),
    [
        # Changes of the video.
        ({"options": ["-use_editlist", "0", "-bf", "2"]}, [], "states 0 to 0.8 s"),
        ({"options": ["-output_ts_offset", "0.5"]}, [], "shows 0.5 to 1.3 s, but"),
        # After a lost image, the later images are shifted, so all episodes are left out.
        ({"pictures": [*range(5), *range(6, 16)]}, [], "shows 0 to 0.75 s, but"),
        ({"places": place(0, to_timestamp=0.35)}, [1], "lacks an image at the time"),
        ({"places": place(1, from_timestamp=0.35)}, [], "episode 1: Parts of .* overlap"),
        ({"places": place(1, from_timestamp=0.42, to_timestamp=0.82)}, [0], "lacks an image at"),
        ({"video_fps": 10, "pictures": range(8)}, [], "lacks an image at the time"),
        # Changes of the keys.
        *(
            ({"rows": change}, [1], "episode 0: .*keys of episode 0 do not fit meta/episodes")
            for change in (
                row(3, frame_index=4),
                row(4, timestamp=np.float32(0.2002)),
                row(4, timestamp=None),
                row(4, index=40),
                lambda rows: [*rows[:3], *rows[4:]],
                lambda rows: [*rows[:8], rows[7], *rows[8:]],
                lambda rows: [*rows[1:3], rows[0], *rows[3:]],
            )
        ),
        ({"rows": every(lambda r: {"timestamp": r["frame_index"] / 10})}, [], "do not fit"),
        ({"rows": every(lambda r: {"timestamp": r["index"] / 20})}, [0], "keys of episode 1"),
        ({"rows": row(9, episode_index=None)}, [0], "keys of episode 1 do not fit"),
        # Changes of `meta/episodes`.
        ({"places": place(0, length=7)}, [1], "keys of episode 0"),
        ({"places": place(0, length=9)}, [1], "episode 0: .* lacks an image at the time of a step"),
        ({"places": place(1, dataset_from_index=7)}, [0], "keys of episode 1"),
        ({"places": lambda entries: entries[:1]}, [0], "episode 1: meta/episodes does not have it"),
        ({"places": lambda entries: entries[1:]}, [1], "episode 0: meta/episodes does not have it"),
        ({"rows": lambda rows: rows[:8]}, [0], "have 0 of the 8 rows of episode 1"),
        # Contradictions that change no step.
        (
            {"info": {"total_episodes": 3}},
            [0, 1],
            r"warning: .*\(3, 16\) .*, and meta/episodes \(2, 16\)",
        ),
        (
            {"pictures": range(18)},
            [0, 1],
            r"warning: .*more images: .* shows 0 to 0\.9 s, but",
        ),
    ],
)
def test_contradictions_are_reported_and_what_they_change_is_left_out(
    tmp_path: Path, options: dict[str, Any], episodes: list[int], reason: str
) -> None:
    """An episode whose keys or times disagree is not imported, and the report states the reason."""
    pairs, context = pairs_of(write_set(tmp_path / "set", **options))
    assert pairs == [BOTH[number] for number in episodes]
    assert re.search(reason, findings_of(context)), context.findings


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_damage_shifts_the_pictures_without_a_warning(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """No step gets a wrong image without a warning, whatever bytes of the tables are damaged."""
    options = ["-g", "4", "-bf", "2", "-movflags", "+faststart"]
    folder = write_set(tmp_path_factory.mktemp("damaged") / "set", options=options)
    content = bytearray((folder / VIDEO).read_bytes())
    start, end = content.index(b"stts"), content.index(b"udta") - 4
    places = st.integers(start, end) | st.integers(0, 23).map(content.index(b"elst").__add__)
    for place in data.draw(st.lists(places, min_size=1, max_size=3)):
        content[place] = data.draw(st.integers(0, 255))
    (folder / VIDEO).write_bytes(content)
    pairs, context = pairs_of(folder)
    shifted = any(step != picture for episode in pairs for step, picture in episode)
    assert not shifted or "warning: " in findings_of(context)


def cut(content: bytearray) -> None:
    del content[-40:]


def claim(table: bytes, offset: int) -> Any:
    """Return a change of a small table, for which FFmpeg would allocate gigabytes."""

    def change(content: bytearray) -> None:
        place = content.index(table) + offset
        content[place : place + 4] = b"\x40\0\0\0"

    return change


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (cut, "cut off"),
        (claim(b"stsz", 12), "claims to have more than"),
        (claim(b"elst", 8), "claims to have more than"),
        (claim(b"stsc", 16), "claims to have more than"),
    ],
)
def test_a_video_with_wrong_tables_is_refused(tmp_path: Path, change: Any, reason: str) -> None:
    folder = write_set(tmp_path / "set", options=["-g", "1", "-movflags", "+faststart"])
    content = bytearray((folder / VIDEO).read_bytes())
    change(content)
    (folder / VIDEO).write_bytes(content)
    pairs, context = pairs_of(folder)
    assert not pairs
    assert reason in findings_of(context)


def test_a_damaged_image(tmp_path: Path) -> None:
    """The episode of a damaged image is left out, and the next episode is imported."""
    folder = write_set(tmp_path / "set", options=["-g", "1", "-movflags", "+faststart"])
    with av.open(str(folder / VIDEO)) as file:
        image = list(file.demux(video=0))[5]
    content = bytearray((folder / VIDEO).read_bytes())
    content[image.pos + 5 : image.pos + image.size] = b"\xff" * (image.size - 5)
    (folder / VIDEO).write_bytes(content)
    pairs, context = pairs_of(folder)
    assert pairs == BOTH[1:]
    assert "is damaged" in findings_of(context)


def test_a_video_of_too_many_pixels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The episodes of a video whose images have more pixels than the limit are left out."""
    folder = write_set(tmp_path / "set")
    monkeypatch.setattr(video, "MAX_PIXELS", SIZE * SIZE - 1)
    pairs, context = pairs_of(folder)
    assert not pairs
    assert "is damaged" in findings_of(context)


def test_rows_are_found_in_other_files_than_stated(tmp_path: Path) -> None:
    """LeRobot's converter to version 3 wrote wrong numbers of files to `meta/episodes`."""
    folder = write_set(tmp_path / "set", places=place(1, **{"data/file_index": 7}))
    table = pq.read_table(folder / DATA)
    second, damaged = ((folder / DATA).with_name(f"file-00{n}.parquet") for n in (1, 2))
    for rows in (8, 5):
        pq.write_table(table.slice(0, rows), folder / DATA)
        pq.write_table(table.slice(rows), second)
        pairs, context = pairs_of(folder)
        assert pairs == BOTH
        assert not context.findings
    damaged.write_bytes(b"PAR1")
    pairs, context = pairs_of(folder)
    assert pairs == BOTH
    assert re.match(f"left out: .*{damaged.name}", findings_of(context))
