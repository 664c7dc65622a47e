"""Small recordings and folders in other formats."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from PIL import Image

from shapechanger.demos.episodes import (
    Episode,
    EpisodeHeader,
    EpisodeWriter,
    Step,
    episodes_of,
    read_episode,
)
from shapechanger.demos.exchange import Converted, ExchangeRecord, Format, ImportContext
from shapechanger.demos.exchange.base import whole_records
from shapechanger.errors import DemosError
from shapechanger.layout import Feature, Layout

ACTIONS = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
STATES = Layout((Feature("speed", "m/s"), Feature("temperature", "°C", -40.0)))


def picture(seed: int, width: int = 40, height: int = 32, *, grey: bool = False) -> bytes:
    pixels = np.random.default_rng(seed).integers(0, 256, (height, width, 1 if grey else 3))
    return simplejpeg.encode_jpeg(
        pixels.astype(np.uint8),
        colorspace="GRAY" if grey else "RGB",
        colorsubsampling="Gray" if grey else "420",
    )


def image_file(pixels: np.ndarray, kind: str = "PNG", mode: str | None = None) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(file, kind)
    return file.getvalue()


def huge(width: int = 60_000, height: int = 60_000) -> bytes:
    """Return a small JPEG whose header claims to be huge."""
    jpeg = bytearray(picture(0))
    at = jpeg.find(b"\xff\xc0") + 5
    jpeg[at : at + 4] = height.to_bytes(2, "big") + width.to_bytes(2, "big")
    return bytes(jpeg)


def header(**changes: Any) -> EpisodeHeader:
    fields: dict[str, Any] = {
        "action_layout": ACTIONS,
        "state_layout": STATES,
        "image_size": (40, 32),
        "driver": "Ada",
        "notes": {"place": "Flur, 2. Stock: ö, 日本"},
    }
    return EpisodeHeader(**(fields | changes))


def record(
    data: Path, what: EpisodeHeader, steps: Sequence[tuple[Step, bytes | None]], outcome: str = ""
) -> Path:
    with EpisodeWriter.create(data, what) as writer:
        for step, jpeg in steps:
            writer.add(step, jpeg)
        writer.close(outcome)
    return writer.path


def drive(data: Path, count: int = 5, **changes: Any) -> Path:
    """Record an episode of a person, with images and a state."""
    steps = [
        (
            Step(
                action=(0.1 * n, 1 / 3),
                driver="person",
                state=(n / 7, float("nan")),
                captured_ns=n * 50_000_000,
                wall_ns=1_700_000_000_000_000_001 + n * 50_000_000,
            ),
            picture(n),
        )
        for n in range(count)
    ]
    return record(data, header(**changes), steps)


def keys_folder(folder: Path) -> Path:
    """Create a table of another program, with the pressed keys of three images."""
    folder.mkdir(parents=True)
    held = ["1.0,0.0,0.0,0.0", "0.0,0.0,0.0,1.0", "0.0,0.0,0.0,0.0"]
    lines = ["file,forward,backward,right,left,timestamp"]
    for n, keys in enumerate(held, 1):
        (folder / f"{n}.jpg").write_bytes(picture(n - 1))
        lines.append(f"{n}.jpg,{keys},1499144070.{n}")
    (folder / "steps.csv").write_bytes("".join(f"{line}\r\n" for line in lines).encode())
    return folder


def tub_folder(
    folder: Path,
    records: Sequence[dict[str, Any]],
    deleted: Sequence[int] = (),
    inputs: dict[str, str] | None = None,
    per_catalog: int = 2,
) -> Path:
    """Create a tub of version 2; each record gets an image unless it sets `cam/image_array`."""
    (folder / "images").mkdir(parents=True)
    kinds = {"cam/image_array": "image_array", "user/angle": "float"} | (inputs or {})
    lines: list[dict[str, Any]] = []
    for index, record_ in enumerate(records):
        name = f"{index}_cam_image_array_.jpg"
        plain = {"cam/image_array": name, "user/mode": "user", "_index": index} | dict(record_)
        if plain["cam/image_array"] == name:
            (folder / "images" / name).write_bytes(picture(index))
        lines.append({key: value for key, value in plain.items() if value is not None})
    paths = []
    for number, start in enumerate(range(0, len(lines), per_catalog)):
        paths.append(f"catalog_{number}.catalog")
        part = lines[start : start + per_catalog]
        (folder / paths[-1]).write_text("".join(json.dumps(line) + "\r\n" for line in part))
    ending = {"paths": paths, "current_index": len(lines), "max_len": per_catalog}
    manifest = [list(kinds), list(kinds.values()), {}, {}, ending | {"deleted_indexes": [*deleted]}]
    (folder / "manifest.json").write_text("".join(json.dumps(line) + "\r\n" for line in manifest))
    return folder


def read_whole(
    folder: Path, form: Format, camera: str = ""
) -> tuple[list[list[ExchangeRecord]], ImportContext]:
    """Read a folder like an import; return the intact records of episodes, and the findings."""
    context = ImportContext(camera=camera)
    found: list[list[ExchangeRecord]] = []
    assert form.read is not None
    for episode in form.read(folder, context):
        try:
            found.append(list(whole_records(episode, context)))
        except DemosError as error:
            context.report("left out", str(error), episode.name)
    return found, context


def findings_of(found: ImportContext | Converted) -> str:
    return "\n".join(f"{kind}: {text}" for kind, text in found.findings)


def all_of(data: Path) -> list[Episode]:
    return [read_episode(path) for path in episodes_of(data)]


def content_of(episode: Episode) -> dict[str, Any]:
    """Return an episode's content without name and start time; NaN is None, which equals itself."""
    head = episode.header.to_json()
    del head["created"]
    kept = {step.index for step in episode.kept}
    return {
        "header": head,
        "steps": [step.to_json() for step in episode.steps],
        "pictures": [episode.jpeg(step) for step in episode.steps],
        "marks": [(mark.step, mark.text) for mark in episode.marks],
        "kept": kept,
        "outcome": episode.outcome,
        "closed": episode.closed,
    }


def snapshot(folder: Path) -> dict[str, bytes]:
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}
