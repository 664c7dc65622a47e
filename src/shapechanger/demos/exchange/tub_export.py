"""Export of recordings as Donkeycar tubs of version 2, which `tub` describes."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.format import (
    COMMANDS,
    ExchangeEpisode,
    ExportContext,
    kept_steps,
    name_in,
)
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

ACTIONS: Final = Layout((COMMANDS["steering"], COMMANDS["throttle"]))
AXES: Final = ("angle", "throttle")
IMAGE, MODE = name_in("tub", "frame"), name_in("tub", "driver")
MANIFEST: Final = "manifest.json"
IMAGES: Final = "images"
LOOP_HZ: Final = "DRIVE_LOOP_HZ"  # Donkeycar's name of the rate.
NS_PER_MS: Final = 1_000_000
NS_PER_S: Final = 1_000_000_000
PERSON_DRIVES: Final = "user"

_POLICY_DRIVES: Final = "local"
_CATALOG_LENGTH: Final = 1000  # Records, as in Donkeycar.

_Fields = dict[str, Any]


def write(episodes: Sequence[ExchangeEpisode], folder: Path, _: ExportContext) -> int:
    """Write episodes as the sessions of one tub of version 2.

    Actions of people, experts and programs become the user's, those of policies the pilot's. Steps
    of a simulated drive get the times of its own clock, since the recorder's tells how fast the
    simulation ran; steps without a time follow the one before at the rate of the episode.
    """
    states = [_state_names(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / IMAGES).mkdir()
    records: list[_Fields] = []
    sessions: list[str] = []
    for number, episode in enumerate(episodes):
        began = _began(episode.header)
        sessions.append(f"{began:%y-%m-%d}_{number}")
        last_ns: int | None = None
        first_ns: int | None = None
        for step, jpeg in kept_steps(episode.rows):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no picture: export it to csv.")
            first_ns = step.clock_ns if first_ns is None else first_ns
            last_ns = _time_ns(step, episode.header, began, first_ns, last_ns)
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            fields |= {IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
            records.append(fields | {"_timestamp_ms": round(last_ns / NS_PER_MS)})
    created_s = _began(episodes[0].header).timestamp()
    floats = ("user/angle", "user/throttle", "pilot/angle", "pilot/throttle", *states[0])
    inputs = {IMAGE: "image_array", MODE: "str"} | dict.fromkeys(floats, "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    rates = {episode.header.control_hz for episode in episodes}
    catalogs = {
        "paths": _write_catalogs(folder, records, created_s),
        "current_index": len(records),
        "max_len": _CATALOG_LENGTH,
        "deleted_indexes": [],
    }
    lines: tuple[object, ...] = (
        list(inputs),
        list(inputs.values()),
        {LOOP_HZ: f"{rates.pop():g}"} if len(rates) == 1 else {},
        {"created_at": created_s, "sessions": named},
        catalogs,
    )
    _write_lines(folder / MANIFEST, [json.dumps(line) for line in lines])
    return len(records)


def _state_names(episode: ExchangeEpisode) -> tuple[str, ...]:
    """Return the names of the values of the state."""
    names = Layout.from_json(episode.header.action_layout).names
    if names != ACTIONS.names:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, but those of a tub are "
            f"{', '.join(ACTIONS.names)}: export it to minari or csv."
        )
    if not episode.header.state_layout:
        return ()
    state = Layout.from_json(episode.header.state_layout)
    if state.size != len(state):
        raise DemosError(f"The state of {episode.name} has array features: export it to csv.")
    return state.names


def _fields(step: Step, state: Sequence[str], where: str) -> _Fields:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    fields: _Fields = {MODE: _POLICY_DRIVES if by_policy else PERSON_DRIVES}
    # A tub always contains the user's action; while a policy drives, it is 0.
    user = (0.0, 0.0) if by_policy else step.action
    fields |= {f"user/{axis}": value for axis, value in zip(AXES, user, strict=True)}
    pilot = step.action if by_policy else step.wanted
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= {f"pilot/{axis}": value for axis, value in zip(AXES, pilot, strict=True)}
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _time_ns(
    step: Step, header: EpisodeHeader, began: datetime, first_ns: int | None, last_ns: int | None
) -> int:
    """Return the Unix time of a step, ns, after the one before."""
    began_ns = round(began.timestamp() * NS_PER_S)
    at_ns = step.wall_ns
    if header.clock == "twin" or (header.clock == "none" and header.env):  # Simulated.
        clock_ns = step.clock_ns
        at_ns = None if clock_ns is None else began_ns + clock_ns - cast("int", first_ns)
    if at_ns is None or (last_ns is not None and at_ns <= last_ns):
        return began_ns if last_ns is None else last_ns + round(NS_PER_S / header.control_hz)
    return at_ns


def _began(header: EpisodeHeader) -> datetime:
    """Return when an episode began; the Unix epoch if unknown."""
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[_Fields], created_s: float) -> list[str]:
    """Write the catalogs, each with its manifest; return the names of the catalogs."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        paths.append(f"catalog_{number}.catalog")
        _write_lines(folder / paths[-1], lines)
        beside = f"{paths[-1]}_manifest"
        kept: _Fields = {"created_at": created_s, "path": beside, "start_index": start}
        kept["line_lengths"] = [len(line) + 1 for line in lines]
        _write_lines(folder / beside, [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")
