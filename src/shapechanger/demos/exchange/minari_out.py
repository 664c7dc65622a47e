"""Writes Minari datasets: see `minari_files`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from itertools import chain, islice
from pathlib import Path
from typing import Any, Final

from shapechanger.demos.episodes import EpisodeHeader
from shapechanger.demos.exchange import minari_files as files
from shapechanger.demos.exchange.libraries import library
from shapechanger.demos.exchange.minari_episode import EpisodeColumns, Observed
from shapechanger.demos.exchange.minari_spaces import box_of
from shapechanger.demos.exchange.pictures import is_grey, size_of
from shapechanger.demos.exchange.recorded import Recorded, Row
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["require_dataset_name", "write_minari"]

_NAME: Final = re.compile(r"[\w-]+-v[0-9]+")
_CHUNK: Final = 256  # Steps that are in memory at once.


def require_dataset_name(folder: Path) -> None:
    """Refuse a folder that Minari could not load by its name.

    Raises:
        DemosError: If the name does not end in a version.
    """
    if not _NAME.fullmatch(folder.name):
        better = re.sub(r"[^\w-]+", "-", folder.name).strip("-") or "drive"
        raise DemosError(
            f"Minari loads a dataset by its name, which ends in a version: call it "
            f"{folder.with_name(f'{better}-v0')}, and not {folder}."
        )


def write_minari(episodes: Sequence[Recorded], folder: Path, name: str) -> int:
    """Write episodes into a folder that is there, as one dataset.

    Neither Minari's own folder nor the network is used. Episodes without steps are left out:
    Minari has no such thing.

    Args:
        episodes: The episodes, of one layout, one rate and one size of pictures.
        folder: Where to write.
        name: Name of the dataset, with its version.

    Returns:
        How many steps were written.

    Raises:
        DemosError: If the episodes differ, or a step has no picture where others have one, or none
            of them has a picture or a state.
        MissingExtra: If Minari or h5py is not installed.
    """
    h5py = library("h5py")
    storages = library("minari.dataset.minari_storage")
    _require_alike(episodes)
    begun = [(episode, rows) for episode in episodes if (rows := _begun(episode.rows)) is not None]
    if not begun:
        raise DemosError("There are no steps to export.")
    first, (row, _) = begun[0]
    observed = _observed(first, row)
    actions = Layout.from_json(first.header.action_layout)
    storage = storages.MinariStorage.new(
        # Minari cannot measure the size of a relative folder.
        (folder / files.DATA).absolute(),
        observation_space=observed.space,
        action_space=box_of(actions),
        data_format="hdf5",
    )
    total, drivers = 0, set[str]()
    with h5py.File(folder / files.DATA / files.MAIN, "a", track_order=True) as file:
        for number, (episode, (row, rest)) in enumerate(begun):
            group = file.create_group(f"episode_{number}")
            columns = EpisodeColumns(group, episode.name, observed, actions.size)
            rows = chain((row,), rest)
            while chunk := list(islice(rows, _CHUNK)):
                columns.add(chunk)
                drivers.update(row.step.driver for row in chunk)
            group.attrs["id"] = number
            group.attrs["total_steps"] = columns.close()
            if episode.header.seed is not None:
                group.attrs["seed"] = episode.header.seed
            total += columns.steps
    storage.update_metadata(
        _metadata(name, [episode for episode, _ in begun], observed, drivers)
        | {"total_episodes": len(begun), "total_steps": total, "dataset_size": storage.get_size()}
    )
    return total


def _begun(rows: Any) -> tuple[Row, Iterator[Row]] | None:
    """The first row and the others; None if there is none."""
    iterator = iter(rows)
    first = next(iterator, None)
    return None if first is None else (first, iterator)


def _observed(episode: Recorded, row: Row) -> Observed:
    """What the first step sees, so all of them must."""
    header = episode.header
    state = Layout.from_json(header.state_layout) if header.state_layout else None
    if row.jpeg is None:
        if header.image_size is not None:
            raise DemosError(
                f"The first step of {episode.name} has no picture, and Minari needs one at every "
                "step: drop the steps before the first picture, or export to csv."
            )
        if state is None:
            raise DemosError(
                f"{episode.name} has neither pictures nor a state, so there is nothing that "
                "Minari could call an observation: export it to csv."
            )
        return Observed(state=state)
    where = f"of the first step of {episode.name}"
    return Observed(
        state=state,
        size=header.image_size or size_of(row.jpeg, where),
        grey=is_grey(row.jpeg, where),
    )


def _require_alike(episodes: Sequence[Recorded]) -> None:
    """Refuse episodes that do not fit into one dataset."""
    for episode in episodes[1:]:
        for what, of in (
            ("actions", _actions),
            ("states", _states),
            ("pictures of", _size),
            ("steps a second:", _rate),
        ):
            ours, theirs = of(episodes[0].header), of(episode.header)
            if ours != theirs:
                raise DemosError(
                    f"{episodes[0].name} has {what} {ours}, and {episode.name} {theirs}: a Minari "
                    "dataset has one kind of episode, so export each kind to a dataset of its own."
                )


def _actions(header: EpisodeHeader) -> str:
    return ", ".join(map(str, Layout.from_json(header.action_layout)))


def _states(header: EpisodeHeader) -> str:
    if not header.state_layout:
        return "of nothing"
    return ", ".join(map(str, Layout.from_json(header.state_layout)))


def _size(header: EpisodeHeader) -> str:
    return "nothing" if header.image_size is None else "{} x {}".format(*header.image_size)


def _rate(header: EpisodeHeader) -> str:
    return f"{header.control_hz:g}"


def _metadata(
    name: str, episodes: Sequence[Recorded], observed: Observed, drivers: set[str]
) -> dict[str, Any]:
    header = episodes[0].header
    found: dict[str, Any] = {
        "dataset_id": name,
        "minari_version": version("minari"),
        "algorithm_name": ", ".join(sorted(drivers)),
        "description": (
            "Episodes recorded by Shapechanger, and exported without a change: pictures are JPEG "
            "as recorded, numbers have 64 bits, the last observation of an episode is there twice."
        ),
        "action_layout": header.to_json()["action_layout"],
        "observation_layout": header.to_json()["state_layout"],
        "control_hz": header.control_hz,
        files.HEADERS: {
            "format": files.HEADERS_FORMAT,
            "episodes": [e.header.to_json() | {"outcome": e.outcome} for e in episodes],
        },
    }
    people = {episode.header.driver for episode in episodes if episode.header.driver}
    if people:
        found["author"] = people
    return found
