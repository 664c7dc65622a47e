"""CSV: a folder with `header.json`, `steps.csv` and `frames/` for each episode.

Numbers are read back exactly. An empty cell is a field that a step lacks, and `nan` is a value that
was not measured. Free texts are JSON with quotes, so that spreadsheets do not evaluate them as
formulas, and line ends and other special characters are kept.

Without a header, `steps.csv` is a table of another program. Its columns are found by their names or
aliases, and its images are in the same folder.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import chain
from pathlib import Path
from typing import Any, Final

import msgspec

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange import base, files
from shapechanger.errors import DemosError, translate_errors
from shapechanger.layout import Layout, value_names

_TABLE: Final = "steps.csv"
_HEADER: Final = "header.json"
_FRAMES: Final = "frames"
_NAMES: Final = {field: names["csv"] for field, names in base.COLUMNS.items()}
_VECTORS: Final = [field for field, name in _NAMES.items() if name.endswith("/")]
_IN_JSON: Final = ("terms", "stop_reason", "marks", "dropped")
_KNOWN_AS: Final = {
    **{key: (_NAMES["action"] + one.name, 1) for key, one in base.COMMANDS.items()},
    **dict.fromkeys(("file", "image", "picture", "filename"), ("frame", 1)),
    **dict.fromkeys(("timestamp", "time"), ("captured_ns", 10**9)),
    **dict.fromkeys(("timestamp_ms", "milliseconds"), ("captured_ns", 10**6)),
    "done": ("terminated", 1),
}
"""Column of `steps.csv` and factor to its unit, keyed by column of other programs' tables."""

_Columns = Mapping[str, Sequence[str]]  # Names of columns, keyed by field of a step.


def _tables_of(folder: Path) -> list[Path]:
    """Return the table in the folder itself, or else the tables in its subfolders."""
    own = folder / _TABLE
    return [own] if own.is_file() else sorted(filter(Path.is_file, folder.glob(f"*/{_TABLE}")))


def _columns(header: EpisodeHeader) -> dict[str, list[str]]:
    values = dict.fromkeys(_VECTORS, value_names(header.action_layout))
    values["state"] = value_names(header.state_layout)
    return {
        field: [name + value for value in values.get(field, [""])] for field, name in _NAMES.items()
    }


def _write(episodes: Sequence[base.ExchangeEpisode], folder: Path, _: base.ExportContext) -> int:
    """Write one episode to the folder itself, or several to a subfolder each."""
    steps = 0
    for number, episode in enumerate(episodes, 1):
        place = folder if len(episodes) == 1 else folder / f"episode-{number:04d}"
        (place / _FRAMES).mkdir(parents=True)
        own = episode.header.to_json() | {"outcome": episode.outcome}
        text = json.dumps(own, indent=1, ensure_ascii=False)
        (place / _HEADER).write_text(text + "\n", encoding="utf-8", errors="replace")
        columns, frame, shown = _columns(episode.header), "", None
        with (place / _TABLE).open("w", encoding="utf-8", errors="replace", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(chain.from_iterable(columns.values()))
            for index, record in enumerate(episode.records):
                if record.jpeg is not None and record.jpeg is not shown:
                    frame, shown = f"{index:06d}.jpg", record.jpeg
                    (place / _FRAMES / frame).write_bytes(shown)
                writer.writerow([index, frame, *_cells(record, columns)])
                steps += 1
    return steps


def _cells(record: base.ExchangeRecord, columns: _Columns) -> Iterator[str]:
    """Yield the cells of a step that follow the cells of its index and image."""
    plain = {"terminated": False, "truncated": False} | record.step.to_json()
    plain |= {"marks": record.marks or None, "dropped": record.dropped}
    for field, names in list(columns.items())[2:]:
        value: Any = plain.get(field)
        if field in _VECTORS:
            values = [""] * len(names) if value is None else value
            yield from ("nan" if one is None else str(one) for one in values)
        elif field == "reward" and record.step.reward is not None:
            yield repr(record.step.reward)
        elif value is None:
            yield ""
        else:
            yield json.dumps(value) if field in _IN_JSON else str(value).lower()


def _read(folder: Path, context: base.ImportContext) -> Iterator[base.ExchangeEpisode]:
    for path in _tables_of(folder):
        place, where = path.parent, path.parent / _HEADER
        (_, names), *lines = files.read_table(path) or [(1, [])]
        names = [name.strip() for name in names]
        if not where.is_file():
            yield from _others(path, names, lines, context)
            continue
        if context.hz is not None:
            raise DemosError("The format csv states the rate itself: leave out --hz.")
        own = files.own_episodes({"format": 1, "episodes": [files.read_json(where)]}, where, 1)
        ((header, outcome, _),) = own
        columns = _columns(header)
        expected = list(chain.from_iterable(columns.values()))
        if names != expected:
            wrong = ", ".join(sorted(set(names) ^ set(expected))[:5]) or "their order"
            raise DemosError(f"{path} has other columns than {where}: {wrong}.")
        records = _records(place / _FRAMES, place.name, names, lines, columns, {})
        if header.image_size is None and any(record.frame for record in records):
            raise DemosError(f"{path} has images, but {where} has no image_size.")
        name = str(place)
        yield base.ExchangeEpisode(header=header, records=records, name=name, outcome=outcome)


def _others(
    path: Path, stated: list[str], lines: list[tuple[int, list[str]]], context: base.ImportContext
) -> Iterator[base.ExchangeEpisode]:
    """Yield the episodes of a table without a header."""
    place = path.parent
    known = dict(_KNOWN_AS.get(name.lower(), (name, 1)) for name in stated)
    columns = {
        field: [n for n in known if (n.startswith(name) if field in _VECTORS else n == name)]
        for field, name in _NAMES.items()
    }
    if not columns["action"]:
        names = ", ".join(base.COMMANDS)
        raise DemosError(f"{path} has neither a {_HEADER} nor a column action/NAME, or {names}.")
    if len(known) < len(stated):
        raise DemosError(f"{path} has two columns of one name: rename one of them.")
    if others := known.keys() - set(chain.from_iterable(columns.values())):
        context.report("note", f"Columns that are not imported: {', '.join(sorted(others))}.")
    keys = [[n.removeprefix(_NAMES[key]) for n in columns[key]] for key in ("action", "state")]
    actions, states = (
        Layout(tuple(base.COMMANDS.get(name) or base.features_of(name, 1)[0] for name in names))
        for names in keys
    )
    header = EpisodeHeader(action_layout=actions, state_layout=states, source="csv")
    records = _records(place, place.name, list(known), lines, columns, known)
    for part, head in base.drives([records], header, context):
        name = f"{place}, from {part[0].name}"
        yield base.ExchangeEpisode(header=head, records=part, name=name)


def _records(
    folder: Path,
    where: str,
    names: Sequence[str],
    lines: list[tuple[int, list[str]]],
    columns: _Columns,
    factors: Mapping[str, int],
) -> list[base.ExchangeRecord]:
    """Return a record for each line of a table, with its image in `folder`.

    `factors` maps the columns of another program's table to the factors to our units; it is empty
    for tables that Shapechanger exported.
    """
    records: list[base.ExchangeRecord] = []
    shown, known, last = "", set[str](), -1
    for position, (line, cells) in enumerate(lines):
        record = base.ExchangeRecord(step=Step(action=(), driver="person"), number=position)
        record.name = f"line {line} of {where}"
        records.append(record)
        try:
            if len(cells) != len(names):
                raise ValueError(f"{len(cells)} cells instead of {len(names)}")
            fields = _fields(dict(zip(names, map(str.strip, cells), strict=True)), columns, factors)
            marks, dropped, frame = (fields.pop(one, None) for one in ("marks", "dropped", "frame"))
            record.marks = msgspec.convert(marks or (), tuple[str, ...])
            record.dropped = msgspec.convert(dropped, str | None)
            record.step = Step.from_json(fields)
            if not factors and record.step.index <= last:
                raise ValueError(f"step {record.step.index} is not after the step before")
            last = record.step.index
            if frame and not files.is_inside(folder, frame):
                raise ValueError("an image name that leaves the folder")
            if shown and not frame:
                raise ValueError("no image")
            if frame != shown and frame in known:
                raise ValueError(f"it returns to the image {frame!r} of an earlier step")
            record.frame, record.image = frame, folder / frame if frame else None
            shown = frame or ""
            known.add(shown)
        except (ValueError, RecursionError, msgspec.ValidationError) as error:
            record.fault = str(error)
    return records


def _fields(
    cells: Mapping[str, str], columns: _Columns, factors: Mapping[str, int]
) -> dict[str, Any]:
    """Return the fields of a step from its cells; empty cells are left out, or NaN in a state."""
    fields: dict[str, Any] = {"driver": "person"} if factors else {}
    fields["state"] = [math.nan] * len(columns["state"])
    for field, names in columns.items():
        values = [cell for name in names if (cell := cells[name])]
        if field in _VECTORS:
            fields |= {field: values} if values else {}
        elif names and (values or field in {"terminated", "truncated"}):
            (name,), text = names, cells[names[0]]
            factor = factors.get(name, 1)
            fields[field] = json.loads(text) if field in _IN_JSON else text
            if factor > 1:
                wrong = ValueError(f"{name} is not a time: {text!r}")
                with translate_errors(ArithmeticError, to=lambda _, wrong=wrong: wrong):
                    fields[field] = int((Decimal(text) * factor).quantize(1))
    return fields


FORMAT: Final = base.Format(
    name="csv",
    title="CSV",
    sign=_TABLE,
    detect=lambda folder: bool(_tables_of(folder)),
    read=_read,
    write=_write,
    options=frozenset({"dropped", "hz"}),
)
