"""From episodes to the formats of others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.demos.exchange.csv_out import write_csv
from shapechanger.demos.exchange.formats import FORMATS, Format
from shapechanger.demos.exchange.keys_2017_out import write_2017
from shapechanger.demos.exchange.minari_out import require_dataset_name, write_minari
from shapechanger.demos.exchange.places import new_folder
from shapechanger.demos.exchange.recorded import recorded_of
from shapechanger.demos.exchange.tub_out import write_tub
from shapechanger.errors import DemosError, OutputError, UnknownName

__all__ = ["Exported", "export_recording"]


@dataclass(frozen=True, slots=True)
class Exported:
    """What was exported.

    Attributes:
        format: The format that it has.
        episodes: How many episodes there were.
        steps: How many steps were written.
        left_out: How many steps were not, because they do not count.
    """

    format: Format
    episodes: int
    steps: int
    left_out: int


def export_recording(data: Path, out: Path, format: str, *, dropped: bool = False) -> Exported:
    """Write a recording in a format of others.

    Args:
        data: A recording, or one episode; it stays as it is.
        out: The folder to make. It appears whole, or not at all.
        format: One of the `FORMATS`.
        dropped: Whether the steps that do not count go with it, and why they do not; only minari
            and csv can say so.

    Raises:
        DemosError: If the recording is not whole, does not fit the format, or `out` exists or lies
            in it.
        UnknownName: If there is no such format.
        OutputError: If `out` cannot be written.
        MissingExtra: If a package that the format needs is not installed.
    """
    if format not in FORMATS:
        raise UnknownName("format", format, FORMATS)
    if dropped and format not in {"minari", "csv"}:
        raise DemosError(
            f"The format {format} cannot say that a step does not count: export to minari or csv, "
            "or leave the dropped steps out."
        )
    if format == "minari":
        require_dataset_name(out)
    read = [read_episode(path) for path in episodes_of(data)]
    kept = sum(len(episode.steps if dropped else episode.kept) for episode in read)
    if not kept:
        raise DemosError(f"No step of {data} counts, so there is nothing to export.")
    episodes = [recorded_of(episode, dropped=dropped) for episode in read]
    with new_folder(out, data) as folder:
        try:
            match format:
                case "2017":
                    steps = write_2017(episodes, folder)
                case "tub":
                    steps = write_tub(episodes, folder)
                case "minari":
                    steps = write_minari(episodes, folder, out.name)
                case _:
                    steps = write_csv(episodes, folder)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"Cannot write {out}: {error.strerror or error}.") from error
        except OverflowError as error:
            raise DemosError(f"A number in {data} is too large for {format}: {error}.") from error
    total = sum(len(episode.steps) for episode in read)
    return Exported(_named(format), len(read), steps, total - steps)


def _named(name: str) -> Format:
    return next(known for known in FORMATS if known == name)
