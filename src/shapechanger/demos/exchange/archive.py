"""Episodes as one tar archive each, for repositories that dislike many small files.

An archive holds `episode.json`, `steps.jsonl` and `frames/`, uncompressed, since pictures are JPEG
already. Equal episodes give equal bytes.
"""

from __future__ import annotations

import re
import shutil
import tarfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from shapechanger.demos.episodes import read_episode
from shapechanger.demos.episodes.files import (
    FRAMES,
    HEADER,
    MAX_PICTURE_BYTES,
    MAX_TEXT_BYTES,
    STEPS,
)
from shapechanger.errors import DemosError
from shapechanger.files import cannot_write

_FRAME: Final = re.compile(FRAMES + r"/\w[\w-]{0,63}\.jpg", re.ASCII)
_PLAIN: Final = {tarfile.REGTYPE, tarfile.AREGTYPE}


def pack_episode(episode: Path, archive: Path) -> None:
    """Write an episode to an archive; its other files, such as `lost/`, are left out.

    Args:
        episode: Folder of an episode.
        archive: The file to create.

    Raises:
        DemosError: If the episode cannot be read.
        OutputError: If the archive cannot be written.
    """
    read = read_episode(episode)
    frames = sorted({step.frame for step in read.steps if step.frame})
    try:
        with tarfile.open(archive, "x:", format=tarfile.USTAR_FORMAT) as file:
            for name in (HEADER, STEPS, *(f"{FRAMES}/{frame}" for frame in frames)):
                member = tarfile.TarInfo(name)
                member.size = (episode / name).stat().st_size
                with (episode / name).open("rb") as content:
                    file.addfile(member, content)
    except OSError as error:
        raise cannot_write(archive, error) from error


def unpack_episodes(archives: Sequence[Path], folder: Path) -> int:
    """Write the episodes of archives, which may come from strangers, into a recording.

    Args:
        archives: The archives; an episode is named after its file.
        folder: An existing folder.

    Returns:
        Number of steps.

    Raises:
        DemosError: If an archive is damaged, holds another file than those of an episode, or one
            that is too large.
        OutputError: If the folder cannot be written to.
    """
    steps = 0
    for archive in archives:
        place = folder / archive.stem
        try:
            (place / FRAMES).mkdir(parents=True)
            with tarfile.open(archive, "r:") as file:
                for member in file:
                    _unpack(file, member, place, archive.name)
        except (tarfile.TarError, EOFError, ValueError) as error:
            if isinstance(error, DemosError):
                raise
            raise DemosError(f"{archive.name} is not an intact tar archive ({error}).") from error
        except OSError as error:
            raise cannot_write(place, error) from error
        steps += len(read_episode(place).steps)
    return steps


def _unpack(file: tarfile.TarFile, member: tarfile.TarInfo, place: Path, archive: str) -> None:
    """Write one file of an archive."""
    name = member.name
    text = name in {HEADER, STEPS}
    # Neither links nor devices, nor sparse files, which unpack to more than the archive has.
    if member.type not in _PLAIN or member.issparse() or not (text or _FRAME.fullmatch(name)):
        raise DemosError(f"{archive} holds {name[:80]!r}, which is no file of an episode.")
    if member.size > (MAX_TEXT_BYTES if text else MAX_PICTURE_BYTES):
        raise DemosError(f"{archive} holds {name!r} of {member.size} bytes, which is too large.")
    content = file.extractfile(member)
    if content is None or (place / name).exists():
        raise DemosError(f"{archive} holds {name!r} twice.")
    with (place / name).open("xb") as out:
        shutil.copyfileobj(content, out)
