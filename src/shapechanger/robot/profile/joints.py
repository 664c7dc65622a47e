"""Reads the joints of a sensor with the driver as5600, each a table of its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from shapechanger.robot.profile.lines import Place
from shapechanger.robot.profile.mistake import Source, called
from shapechanger.robot.profile.schema import JOINT_KEYS
from shapechanger.robot.profile.table import read_keys, refuse_bad_name, refuse_unknown_keys

__all__ = ["joints_in", "read_joints"]


def joints_in(table: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The tables in the table of a sensor, by the names of the joints."""
    return {name: cast("dict[str, Any]", t) for name, t in table.items() if isinstance(t, dict)}


def read_joints(
    source: Source, place: Place, joints: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """The settings that the joints give, as lists in the order of the file.

    Args:
        source: Where the profile was read.
        place: The sensor.
        joints: The table of each joint.

    Returns:
        `joints`, their names, and their `channels`, `zeros` and `directions`.

    Raises:
        ProfileError: If there are none, a key is unknown, missing or wrong, or a channel is used
            twice.
    """
    if not joints:
        words = f"{called(place)} needs a table for each joint, such as {called((*place, 'knee'))}"
        raise source.mistake(place, words)
    rows: list[dict[str, Any]] = []
    users: dict[int, str] = {}
    for name, table in joints.items():
        at = (*place, name)
        refuse_bad_name(source, at)
        refuse_unknown_keys(source, table, at, [key.name for key in JOINT_KEYS])
        row = read_keys(source, table, at, JOINT_KEYS)
        if row["direction"] == 0:
            words = f"direction of {called(at)} must be 1 or -1, not 0"
            raise source.mistake((*at, "direction"), words)
        other = users.setdefault(row["channel"], name)
        if other != name:
            words = f"channel {row['channel']} of {called(at)} is that of {other}, too"
            raise source.mistake((*at, "channel"), words)
        rows.append(row)
    return {
        "joints": list(joints),
        "channels": [row["channel"] for row in rows],
        "zeros": [row["zero"] for row in rows],
        "directions": [row["direction"] for row in rows],
    }
