"""Writes Donkeycar's tubs, of version 2: see `tub`."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.recorded import Recorded, seen
from shapechanger.demos.exchange.tub_files import IMAGES, MANIFEST
from shapechanger.demos.exchange.tub_record import IMAGE, MODE, TUB_ACTIONS, USER
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["write_tub"]

_CATALOG_LENGTH: Final = 1000  # Records, as Donkeycar has it.
_PILOT: Final = "local"
_NS_PER_MS: Final = 1_000_000
_MS_PER_S: Final = 1000.0


def write_tub(episodes: Sequence[Recorded], folder: Path) -> int:
    """Write episodes into a folder that is there, as the sessions of one tub.

    What people, experts and programs did is the user's in a tub, and what policies did the
    pilot's. Steps whose time nobody knows get times from the rate of the episode.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If an episode has other actions than steering and throttle, or a step has no
            picture.
    """
    states = [_require(episode) for episode in episodes]
    if any(state != states[0] for state in states):
        raise DemosError("The episodes have different states: export each kind to its own tub.")
    (folder / IMAGES).mkdir()
    records: list[dict[str, Any]] = []
    sessions: list[str] = []
    for number, episode in enumerate(episodes):
        sessions.append(f"{_created(episode.header):%y-%m-%d}_{number}")
        for step, jpeg in seen(episode.rows):
            if jpeg is None:
                raise DemosError(f"A step of {episode.name} has no picture: export it to csv.")
            name = f"{len(records)}_cam_image_array_.jpg"
            (folder / IMAGES / name).write_bytes(jpeg)
            fields = _fields(step, states[0], f"{episode.name}, record {len(records)}")
            records.append(
                fields
                | {IMAGE: name, "_session_id": sessions[-1], "_index": len(records)}
                | {"_timestamp_ms": _time_ms(step, episode.header, len(records))}
            )
    created_s = _created(episodes[0].header).timestamp()
    paths = _write_catalogs(folder, records, created_s)
    inputs = {IMAGE: "image_array", "user/angle": "float", "user/throttle": "float", MODE: "str"}
    inputs |= {"pilot/angle": "float", "pilot/throttle": "float"}
    inputs |= dict.fromkeys(states[0], "float")
    named = {"all_full_ids": sessions, "last_id": len(sessions) - 1, "last_full_id": sessions[-1]}
    lines: Iterable[object] = (
        list(inputs),
        list(inputs.values()),
        {},
        {"created_at": created_s, "sessions": named},
        {
            "paths": paths,
            "current_index": len(records),
            "max_len": _CATALOG_LENGTH,
            "deleted_indexes": [],
        },
    )
    _write_lines(folder / MANIFEST, [json.dumps(line) for line in lines])
    return len(records)


def _require(episode: Recorded) -> tuple[str, ...]:
    """The names of the state of an episode that a tub can hold."""
    names = Layout.from_json(episode.header.action_layout).names
    if names != TUB_ACTIONS.names:
        raise DemosError(
            f"The actions of {episode.name} are {', '.join(names)}, and those of a tub "
            f"{', '.join(TUB_ACTIONS.names)}: export it to minari or csv."
        )
    if not episode.header.state_layout:
        return ()
    state = Layout.from_json(episode.header.state_layout)
    if state.size != len(state):
        raise DemosError(f"The state of {episode.name} has blocks of numbers: export it to csv.")
    return state.names


def _fields(step: Step, state: Sequence[str], where: str) -> dict[str, Any]:
    by_policy = step.driver == "policy"
    if any(abs(value) > 1.0 for value in step.action):
        raise DemosError(f"{where}: the action {list(step.action)} is not from -1 to 1.")
    fields: dict[str, Any] = {MODE: _PILOT if by_policy else USER}
    # A tub always says what the user held; while a policy drives, that is nothing.
    fields |= _pair("user", (0.0, 0.0) if by_policy else step.action)
    pilot = step.action if by_policy else step.wanted
    if pilot is not None and all(abs(value) <= 1.0 for value in pilot):
        fields |= _pair("pilot", pilot)
    known = zip(state, step.state, strict=True)
    return fields | {name: value for name, value in known if math.isfinite(value)}


def _pair(who: str, values: Sequence[float]) -> dict[str, float]:
    return {f"{who}/angle": values[0], f"{who}/throttle": values[1]}


def _time_ms(step: Step, header: EpisodeHeader, number: int) -> int:
    """Unix time of a step, ms."""
    if step.wall_ns is not None:
        return step.wall_ns // _NS_PER_MS
    return round((_created(header).timestamp() + number / header.control_hz) * _MS_PER_S)


def _created(header: EpisodeHeader) -> datetime:
    """When an episode began; the beginning of Unix time where it does not say."""
    try:
        return datetime.fromisoformat(header.created)
    except ValueError:
        return datetime.fromtimestamp(0.0, UTC)


def _write_catalogs(folder: Path, records: Sequence[dict[str, Any]], created_s: float) -> list[str]:
    """Write the records, and beside each catalog what Donkeycar keeps of its lines."""
    paths: list[str] = []
    for number, start in enumerate(range(0, len(records), _CATALOG_LENGTH)):
        part = records[start : start + _CATALOG_LENGTH]
        lines = [json.dumps(record, allow_nan=False, sort_keys=True) for record in part]
        paths.append(f"catalog_{number}.catalog")
        _write_lines(folder / paths[-1], lines)
        beside = f"catalog_{number}.catalog_manifest"
        kept = {
            "created_at": created_s,
            "line_lengths": [len(line) + 1 for line in lines],
            "path": beside,
            "start_index": start,
        }
        _write_lines(folder / beside, [json.dumps(kept, sort_keys=True)])
    return paths


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")
