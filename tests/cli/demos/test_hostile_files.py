"""`shapechanger demos` given files of an attacker: one sentence, little memory and no other file.

Each command runs with 384 MiB of memory, ten seconds of processor time and 64 MiB of disk.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest

from shapechanger.demos.episodes.records import decode_line, encode_line
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.demos.jpeg import picture_size
from shapechanger.errors import DemosError
from tests.demos.exchange.small import drive, picture

pytestmark = [pytest.mark.system, pytest.mark.realtime]

GIB = 1 << 30
HUGE = 10**400  # More than a float holds.

Jail = Callable[..., tuple[int, str]]


@pytest.fixture(scope="module")
def jail() -> Iterator[Jail]:
    """Run `shapechanger demos` with limits; returns the exit code and the output."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "400"}
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
    """Make a file that claims `size` bytes and stores none."""
    path.unlink(missing_ok=True)
    with path.open("wb") as file:
        file.truncate(size)


def pipe(path: Path) -> None:
    """Replace a file by a pipe that nobody writes to."""
    path.unlink()
    os.mkfifo(path)


def link(path: Path, target: str) -> None:
    """Replace a file by a link."""
    path.unlink(missing_ok=True)
    path.symlink_to(target)


def header_with(**fields: object) -> Callable[[Path], None]:
    """Return a change of an episode's header."""

    def change(episode: Path) -> None:
        path = episode / "episode.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | fields))

    return change


def steps_with(**fields: object) -> Callable[[Path], None]:
    """Return a change of all steps of an episode, with right checksums."""

    def change(episode: Path) -> None:
        path = episode / "steps.jsonl"
        lines = [decode_line(line) for line in path.read_bytes().splitlines(keepends=True)]
        for line in lines:
            line.pop("crc", None)
        path.write_bytes(b"".join(encode_line(line | fields) for line in lines))

    return change


def added(line: dict[str, Any] | bytes) -> Callable[[Path], None]:
    """Return a change that appends a line to the steps."""

    def change(episode: Path) -> None:
        with (episode / "steps.jsonl").open("ab") as file:
            file.write(line if isinstance(line, bytes) else encode_line(line))

    return change


def nested(depth: int = 100_000) -> bytes:
    """Return a line of deeply nested JSON with a right checksum."""
    import binascii

    body = b'{"kind":' + b"[" * depth + b"]" * depth
    return body + b',"crc":"%08x"}\n' % binascii.crc32(body)


LAYOUT = {"features": [{"name": "x", "unit": "1", "shape": [10**6, 10**6]}]}

EPISODES: dict[str, Callable[[Path], object]] = {
    "a header of 8 GiB": lambda e: sparse(e / "episode.json", 8 * GIB),
    "steps of 8 GiB": lambda e: sparse(e / "steps.jsonl", 8 * GIB),
    "steps that are a pipe": lambda e: pipe(e / "steps.jsonl"),
    "steps that are a device": lambda e: link(e / "steps.jsonl", "/dev/zero"),
    "a header that is a device": lambda e: link(e / "episode.json", "/dev/zero"),
    "a picture that is a device": lambda e: (
        steps_with(frame=["000009.jpg", 0, "0"])(e),
        link(e / "frames/000009.jpg", "/dev/zero"),
    ),
    "a picture that is a pipe": lambda e: (
        steps_with(frame=["000001.jpg", 0, "0"])(e),
        pipe(e / "frames/000001.jpg"),
    ),
    "a picture of 8 GiB": lambda e: (
        steps_with(frame=["000001.jpg", 8 * GIB, "0"])(e),
        sparse(e / "frames/000001.jpg", 8 * GIB),
    ),
    "a picture elsewhere": steps_with(frame=["../../../secret.jpg", 6, "0"]),
    "a header nested deeply": lambda e: (e / "episode.json").write_bytes(b"[" * 100_000),
    "a step nested deeply": added(nested()),
    "a step that is cut off": lambda e: (e / "steps.jsonl").write_bytes(
        (e / "steps.jsonl").read_bytes()[:-20]
    ),
    "a layout of 10^12 values": header_with(action_layout=LAYOUT),
    "a state of 10^12 values": header_with(state_layout=LAYOUT),
    "a layout without features": header_with(action_layout={"features": 7}),
    "a rate of nothing": header_with(control_hz=1e-320),
    "a rate that is text": header_with(control_hz="20"),
    "an action of 10^400": steps_with(action=[HUGE, 0]),
    "a time of 10^400": steps_with(captured_ns=HUGE),
    "an index of 10^400": steps_with(step=HUGE),
    "a driver that is a list": steps_with(driver=["person"]),
    "terms that are text": steps_with(terms="x" * 1000),
}


@pytest.mark.parametrize("name", EPISODES)
def test_a_hostile_episode_is_refused(tmp_path: Path, jail: Jail, name: str) -> None:
    """By each command that reads episodes; `list` goes on with the next one."""
    (tmp_path / "secret.jpg").write_text("secret")
    episode = drive(tmp_path / "data")
    EPISODES[name](episode)
    out = tmp_path / "out"
    for command in (
        ("merge", tmp_path / "data", "--out", out),
        ("export", tmp_path / "data", "--out", out, "--to", "csv"),
        ("train", tmp_path / "data", "--out", tmp_path / "policy.safetensors"),
    ):
        code, text = jail(*command)
        assert code == 2, text
        assert one_sentence(text), text
        assert not out.exists()
    code, text = jail("list", tmp_path / "data")
    assert code in {0, 2}, text
    assert "Traceback" not in text


def one_sentence(text: str) -> bool:
    """Return whether an output is one line about the error."""
    lines = text.strip().splitlines()
    return len(lines) == 1 and lines[0].startswith("error: ") and lines[0].endswith(".")


def test_a_picture_of_many_scans_is_refused() -> None:
    """Each scan takes the time of a picture, and a few bytes of header claim thousands."""
    jpeg = picture(0)
    start = jpeg.index(b"\xff\xda")
    with pytest.raises(DemosError, match="more than 64 scans"):
        picture_size(jpeg[:start] + jpeg[start:-2] * 500 + b"\xff\xd9", "bomb.jpg")


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("soft link", "links are not followed"),
        ("external link", "in another file"),
        ("chunk of a gigabyte", "more than the limit"),
        ("claimed steps", "claims at least"),
    ],
)
def test_a_hostile_minari_dataset_is_refused(how: str, words: str, tmp_path: Path) -> None:
    """Links, and arrays that HDF5 stores in no bytes."""
    drive(tmp_path / "data")
    export_recording(tmp_path / "data", tmp_path / "minari-v0", "minari")
    (main,) = (tmp_path / "minari-v0").rglob("*.hdf5")
    with h5py.File(main, "a") as file:
        rewards = "episode_0/rewards"
        del file[rewards]
        if how == "soft link":
            file[rewards] = h5py.SoftLink("/episode_0/terminations")
        elif how == "external link":
            file[rewards] = h5py.ExternalLink("/etc/passwd", "/x")
        elif how == "chunk of a gigabyte":
            file.create_dataset(rewards, (1 << 27,), "f8", chunks=(1 << 27,), compression="gzip")
        else:
            file.create_dataset(rewards, (1 << 40,), "f8", chunks=(1 << 10,))
    with pytest.raises(DemosError, match=words):
        import_recording(tmp_path / "minari-v0", tmp_path / "out")
