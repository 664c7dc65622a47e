"""`shapechanger demos` with files of an attacker: each is refused in one sentence.

Each command runs with 384 MiB of memory, ten seconds of processor time and 64 MiB of disk.
"""

from __future__ import annotations

import binascii
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from shapechanger.demos.episodes.records import encode_line
from shapechanger.demos.exchange import export_recording
from shapechanger.demos.jpeg import picture_size
from shapechanger.errors import DemosError
from tests.demos.exchange.small import drive, huge, picture, tub_folder

pytestmark = [pytest.mark.system, pytest.mark.realtime]

GIB = 1 << 30
HUGE = 10**400  # Larger than any float.

Jail = Callable[..., tuple[int, str]]


@pytest.fixture(scope="module")
def jail() -> Iterator[Jail]:
    environment = os.environ | {"COLUMNS": "400"}
    command = [sys.executable, "-m", "tests.cli.demos.jail"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:

        def run(*arguments: object) -> tuple[int, str]:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(json.dumps(["demos", *map(str, arguments)]) + "\n")
            process.stdin.flush()
            code, text = json.loads(process.stdout.readline())
            return code, text

        yield run
        process.kill()


def sparse(path: Path, size: int) -> None:
    path.unlink(missing_ok=True)
    with path.open("wb") as file:
        file.truncate(size)


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def link(path: Path, target: str) -> None:
    path.unlink(missing_ok=True)
    path.symlink_to(target)


def header_with(**fields: object) -> Callable[[Path], None]:
    def change(episode: Path) -> None:
        path = episode / "episode.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | fields))

    return change


def steps_with(**fields: object) -> Callable[[Path], None]:
    """Return a function that changes all steps of an episode, with valid checksums."""

    def change(episode: Path) -> None:
        path = episode / "steps.jsonl"
        lines = [json.loads(line) for line in path.read_bytes().splitlines()]
        for line in lines:
            line.pop("crc", None)
        path.write_bytes(b"".join(encode_line(line | fields) for line in lines))

    return change


def added(line: dict[str, Any] | bytes) -> Callable[[Path], None]:
    def change(episode: Path) -> None:
        with (episode / "steps.jsonl").open("ab") as file:
            file.write(line if isinstance(line, bytes) else encode_line(line))

    return change


def nested_in(name: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text("[" * 100_000)


def nested(depth: int = 100_000) -> bytes:
    body = b'{"kind":' + b"[" * depth + b"]" * depth
    return body + b',"crc":"%08x"}\n' % binascii.crc32(body)


LAYOUT = {"features": [{"name": "x", "unit": "1", "shape": [10**6, 10**6]}]}


def test_a_picture_of_many_scans_is_refused() -> None:
    """Each scan takes as long to decode as an image, and few bytes can add thousands of scans."""
    jpeg = picture(0)
    start = jpeg.index(b"\xff\xda")
    with pytest.raises(DemosError, match="more than 64 scans"):
        picture_size(jpeg[:start] + jpeg[start:-2] * 500 + b"\xff\xd9", "bomb.jpg")


def refuse(answer: tuple[int, str]) -> str:
    code, text = answer
    assert code == 2, text
    assert text.startswith("error: ")
    assert text.endswith(".\n")
    assert text.count("\n") == 1, text
    return text


def framed(jpeg: bytes) -> Callable[[Path], None]:
    """Return a function that replaces all images of an episode, with valid size and checksum."""

    def change(episode: Path) -> None:
        (episode / "frames/000000.jpg").write_bytes(jpeg)
        steps_with(frame=["000000.jpg", len(jpeg), f"{binascii.crc32(jpeg):08x}"])(episode)

    return change


Spoilt = dict[str, tuple[Callable[[Path], object], str]]
"""Changes of a recording, and a part of the expected error, keyed by name."""

EPISODES: Spoilt = {
    name: (spoil, "")
    for name, spoil in {
        "a header of 8 GiB": lambda e: sparse(e / "episode.json", 8 * GIB),
        "steps of 8 GiB": lambda e: sparse(e / "steps.jsonl", 8 * GIB),
        "steps that are a pipe": lambda e: pipe(e / "steps.jsonl"),
        "steps that are a device": lambda e: link(e / "steps.jsonl", "/dev/zero"),
        "an image that is a device": lambda e: (
            steps_with(frame=["000009.jpg", 0, "0"])(e),
            link(e / "frames/000009.jpg", "/dev/zero"),
        ),
        "an image of 8 GiB": lambda e: (
            steps_with(frame=["000001.jpg", 8 * GIB, "0"])(e),
            sparse(e / "frames/000001.jpg", 8 * GIB),
        ),
        "an image elsewhere": steps_with(frame=["../../../secret.jpg", 6, "0"]),
        "a header nested deeply": nested_in("episode.json"),
        "a step nested deeply": added(nested()),
        "a layout of 10^12 values": header_with(action_layout=LAYOUT),
        "a rate of nothing": header_with(control_hz=1e-320),
        "an action of 10^400": steps_with(action=[HUGE, 0]),
    }.items()
}
PICTURES: Spoilt = {
    "an image of 60000 x 60000 pixels": (framed(huge()), ""),
    "an image that is no JPEG": (framed(bytes(1000)), ""),
    "an image that is cut off": (framed(picture(0)[:-200]), ""),
}


@pytest.mark.parametrize("command", ["show", "merge", "import", "export", "train", "repair"])
def test_a_file_instead_of_a_folder_is_refused(tmp_path: Path, jail: Jail, command: str) -> None:
    """An archive is not unpacked; a pickle, an HDF5 file or a pipe is not opened."""
    options = {
        "merge": ("--out", tmp_path / "out"),
        "import": ("--out", tmp_path / "out"),
        "export": ("--out", tmp_path / "out", "--to", "csv"),
        "train": ("--out", tmp_path / "policy.safetensors"),
    }
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as archive:
        archive.writestr("steps.csv", "steering\n0\n")
    (tmp_path / "evil.pkl").write_bytes(b"cos\nsystem\n(S'touch pwned'\ntR.")
    sparse(tmp_path / "evil.hdf5", 8 * GIB)
    os.mkfifo(tmp_path / "pipe")
    for name in ("evil.zip", "evil.pkl", "evil.hdf5", "pipe"):
        text = refuse(jail(command, tmp_path / name, *options.get(command, ())))
        assert "is a file" in text


@pytest.mark.parametrize("target", ["/etc/passwd", "/etc", ".."])
def test_merge_does_not_follow_links(tmp_path: Path, jail: Jail, target: str) -> None:
    """Otherwise the merged recording could contain private files of the user who merges it."""
    link(drive(tmp_path / "data") / "frames/extra", target)
    text = refuse(jail("merge", tmp_path / "data", "--out", tmp_path / "out"))
    assert "is a link" in text
    assert not (tmp_path / "out").exists()


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text, text
    path.write_text(text.replace(old, new))


TUBS: Spoilt = {
    "a catalog twice": (
        lambda f: edit(f / "manifest.json", '"catalog_1.catalog"', '"catalog_0.catalog"'),
        "names a catalog twice",
    ),
    "an image of 60000 x 60000 pixels": (
        lambda f: (f / "images/1_cam_image_array_.jpg").write_bytes(huge()),
        "record 1: a damaged image",
    ),
    "a catalog of 8 GiB": (lambda f: sparse(f / "catalog_0.catalog", 8 * GIB), "the limit"),
    "a catalog that is a pipe": (lambda f: pipe(f / "catalog_0.catalog"), "There is no"),
    "a catalog nested deeply": (nested_in("catalog_0.catalog"), "damaged JSON"),
}


ROWS = "data/chunk-000/file-000.parquet"
PLACES = "meta/episodes/chunk-000/file-000.parquet"
CAMERA = "observation.images.camera"


def column(name: str, key: str, values: Callable[[int], object]) -> Callable[[Path], None]:
    """Return a function that changes a column of a Parquet file, and compresses the file."""

    def change(folder: Path) -> None:
        table = pq.read_table(folder / name)
        place = table.schema.get_field_index(key)
        array = pa.array(values(len(table)), table.schema.field(place).type)
        table = table.set_column(place, key, array)
        pq.write_table(table, folder / name, compression="zstd", data_page_size=1 << 30)

    return change


def many_rows(folder: Path) -> None:
    table = pq.read_table(folder / ROWS).take([0])
    part = pa.concat_tables([table] * 1000).combine_chunks()
    repeated = pa.concat_tables([part] * 1000)
    pq.write_table(repeated, folder / ROWS, compression="zstd", row_group_size=len(repeated))


def two_pictures(count: int) -> list[dict[str, object]]:
    """Return `count` rows with two large images in turn, so that consecutive rows differ."""
    jpegs = [picture(n, 40, 32) + bytes(15 << 20) for n in (0, 1)]
    return [{"bytes": jpegs[n % 2], "path": ""} for n in range(count)]


LEROBOTS: Spoilt = {
    "a task of 96 MiB": (
        column(PLACES, "tasks", lambda n: [["x" * (96 << 20)], *[["x"]] * (n - 1)]),
        "bytes, but claims",
    ),
    "a task of 8 MiB": (column(PLACES, "tasks", lambda n: [["x" * (8 << 20)]] * n), "<= 4096"),
    "an image of 128 MiB": (
        column(ROWS, CAMERA, lambda n: [{"bytes": bytes((n == 0) << 27)} for n in range(n)]),
        "bytes, but claims",
    ),
    "two images of 15 MiB in all rows": (column(ROWS, CAMERA, two_pictures), "far more bytes"),
    "a million rows": (many_rows, "bytes, but claims"),
    "an episode twice": (column(PLACES, "episode_index", lambda n: [0] * n), "each episode once"),
    "an action of 10^9 values": (
        lambda f: edit(f / "meta/info.json", "2\n            ],", "1000000000\n            ],"),
        "no numeric feature 'action'",
    ),
    "rows that are a pipe": (lambda f: pipe(f / ROWS), "There is no"),
    "metadata of 8 GiB": (lambda f: sparse(f / PLACES, 8 * GIB), "not an intact Parquet file"),
    "metadata nested deeply": (nested_in("meta/info.json"), "not valid JSON"),
}


REWARDS = "episode_0/rewards"
ACTIONS = "episode_0/actions"


def endless(file: h5py.File, place: str) -> None:
    file.create_dataset(place, (1 << 40,), "f8", chunks=(1 << 10,))
    group = file["episode_0"]
    group.attrs["total_steps"] = 1 << 40
    infos = ("infos/step", "infos/frame", "observations/image", "observations/state")
    for name in ("actions", "terminations", "truncations", *infos):
        group[name].resize(1 << 40, axis=0)


def stored(place: str, spoil: Callable[[h5py.File, str], object]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        with h5py.File(folder / "data/main_data.hdf5", "a") as file:
            del file[place]
            spoil(file, place)

    return change


def space_of_others(folder: Path) -> None:
    """Declare a space of 10^9 numbers, for which Minari would allocate memory."""
    path = folder / "data/metadata.json"
    known = {"total_episodes", "data_format", "dataset_id"}
    fields = {key: value for key, value in json.loads(path.read_text()).items() if key in known}
    space = {"type": "Box", "dtype": "float32", "shape": [10**9], "low": -1.0, "high": 1.0}
    spaces = dict.fromkeys(("observation_space", "action_space"), json.dumps(space))
    path.write_text(json.dumps(fields | spaces))


DATASETS: Spoilt = {
    "an external link": (
        stored(REWARDS, lambda f, at: f.__setitem__(at, h5py.ExternalLink("/etc/passwd", "/x"))),
        "has no 'rewards' that is an array in this file",
    ),
    "a chunk of a gigabyte": (
        stored(
            REWARDS,
            lambda f, at: f.create_dataset(
                at, (1 << 27,), "f8", chunks=(1 << 27,), compression="gzip"
            ),
        ),
        "bytes: too many",
    ),
    "10^12 steps": (stored(REWARDS, endless), "claims at least"),
    "10^12 values in a step": (
        stored(
            ACTIONS, lambda f, at: f.create_dataset(at, (5, 1 << 40), "f8", chunks=(1, 1 << 10))
        ),
        "bytes: too many",
    ),
    "a space of 10^9 values": (space_of_others, "must consist of Box or Discrete"),
}


def a_tub(folder: Path) -> Path:
    records = [{"user/angle": 0.0, "user/throttle": 0.1, "_timestamp_ms": 50 * n} for n in range(4)]
    return tub_folder(folder, records)


def a_lerobot_dataset(folder: Path) -> Path:
    """Export two episodes, without the mark that Shapechanger has written them."""
    for count in (30, 2):
        drive(folder.with_name("drives"), count)
    export_recording(folder.with_name("drives"), folder, "lerobot", images=True)
    (folder / "meta/shapechanger.json").unlink()
    return folder


def a_minari_dataset(folder: Path) -> Path:
    drive(folder.with_name("drives"))
    export_recording(folder.with_name("drives"), folder, "minari")
    return folder


HOSTILE = (
    (drive, EPISODES, ("merge", "--out", "out")),
    (drive, PICTURES, ("export", "--out", "out-v0", "--to", "minari")),
    (drive, EPISODES | PICTURES, ("train", "--out", "policy.safetensors")),
    (a_tub, TUBS, ("import", "--out", "out", "--strict")),
    (a_lerobot_dataset, LEROBOTS, ("import", "--out", "out")),
    (a_minari_dataset, DATASETS, ("import", "--out", "out")),
)
"""Recordings, changes that damage them, and the command that reads them."""


@pytest.mark.parametrize(
    ("make", "spoil", "message", "command"),
    [
        pytest.param(make, *spoilt, command, id=f"{command[0]}: {name}")
        for make, all_spoilt, command in HOSTILE
        for name, spoilt in all_spoilt.items()
    ],
)
def test_a_hostile_recording_is_refused(
    tmp_path: Path,
    jail: Jail,
    make: Callable[[Path], Path],
    spoil: Callable[[Path], object],
    message: str,
    command: tuple[str, ...],
) -> None:
    """The error is one sentence, and no file is written; `show` prints no traceback."""
    (tmp_path / "secret.jpg").write_text("secret")
    folder = tmp_path / "data-v0"
    spoil(make(folder))
    name, option, out, *more = command
    assert message in refuse(jail(name, folder, option, tmp_path / out, *more))
    assert not (tmp_path / out).exists()
    assert "Traceback" not in jail("show", folder)[1]
