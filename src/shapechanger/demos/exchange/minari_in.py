"""Reads Minari datasets: those that `minari_out` wrote, and those of others."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast

from gymnasium import spaces

from shapechanger.demos.exchange import minari_files as files
from shapechanger.demos.exchange.libraries import library
from shapechanger.demos.exchange.minari_foreign import read_foreign
from shapechanger.demos.exchange.minari_own import read_own
from shapechanger.demos.exchange.places import inside, read_text
from shapechanger.demos.exchange.recorded import Recorded
from shapechanger.errors import DemosError, MissingExtra

__all__ = ["read_minari"]


def read_minari(folder: Path) -> Iterator[Recorded]:
    """The episodes of a dataset; neither Minari's own folder nor the network is used.

    Raises:
        DemosError: If something in it is not whole, or no layout can be made for its spaces.
        MissingExtra: If Minari or h5py is not installed.
    """
    place = files.data_folder(folder)
    if place is None:
        raise DemosError(f"There is no Minari dataset in {folder}: one has {files.METADATA}.")
    path = place / files.METADATA
    try:
        plain = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise DemosError(f"{path} is no JSON: {error}.") from error
    if not isinstance(plain, dict):
        raise DemosError(f"{path} is no metadata of a Minari dataset.")
    metadata = cast("dict[str, Any]", plain)
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, and only 'hdf5' is read: create "
            "it with data_format='hdf5'."
        )
    main = inside(place, files.MAIN, str(path))
    count = metadata.get("total_episodes")
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise DemosError(f"{path} says that there are {count!r} episodes.")
    if files.HEADERS in metadata:
        yield from read_own(main, metadata[files.HEADERS], count)
        return
    yield from read_foreign(
        main,
        _space(metadata, "observation_space", path),
        _space(metadata, "action_space", path),
        count,
        jpeg=bool(metadata.get("jpeg_encoding", True)),
        said={name: metadata[name] for name in ("dataset_id", "control_hz") if name in metadata},
    )


def _space(metadata: dict[str, Any], name: str, path: Path) -> spaces.Space[Any]:
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so nobody knows what its numbers are: create the dataset anew "
            "with this space."
        )
    try:
        return library("minari.serialization").deserialize_space(text)
    except MissingExtra:
        raise
    except Exception as error:  # What it raises for nonsense is not written down.
        raise DemosError(f"The {name} in {path} cannot be read: {error}.") from error
