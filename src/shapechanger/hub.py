"""Policies and demonstrations on the Hugging Face Hub.

A pushed repository contains a card for people (`README.md`), the files, and `shapechanger.json`, a
list with the size and the SHA-256 of each file. A pull downloads only files of the requested kind
that this list names, and checks them. Policies are models on the Hub, and demonstrations datasets.

Log in with `hf auth login`, or set the variable HF_TOKEN. Messages of this module do not quote
messages of other packages, which might contain the token.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from importlib.metadata import version
from multiprocessing.pool import ThreadPool
from pathlib import Path
from textwrap import indent
from typing import Any, Final, Literal

import msgspec

from shapechanger.errors import HubError, OutputError, ShapechangerError, needing_extra
from shapechanger.layout import Layout

Kind = Literal["policy", "demonstrations"]

POLICY: Final = "policy.safetensors"
EPISODES: Final = "episodes"
_LIST, _CARD = "shapechanger.json", "README.md"
_FORMAT: Final = 1
_TYPES: Final[dict[Kind, str]] = {"policy": "model", "demonstrations": "dataset"}
_PLACES: Final[dict[Kind, str]] = {"policy": POLICY, "demonstrations": EPISODES}
_EPISODE_FILE: Final = r"(episode\.json|steps\.jsonl|frames/\w[\w-]{0,63}\.jpg)"
_NAMES: Final[dict[Kind, re.Pattern[str]]] = {
    "policy": re.compile(re.escape(POLICY)),
    "demonstrations": re.compile(rf"{EPISODES}/\w[\w.-]{{0,127}}/{_EPISODE_FILE}", re.ASCII),
}
_MAX_LIST_BYTES: Final = 64 << 20
_TRANSFERS: Final = 8  # Parallel downloads, the default of huggingface_hub.
_LOG_IN: Final = "log in with `hf auth login`, or set HF_TOKEN"


class _File(msgspec.Struct):
    bytes: int
    sha256: str


class _Listed(msgspec.Struct):
    kind: str = ""
    files: dict[str, _File] = {}
    format: int = 0
    version: str = ""


def features_text(layout: Layout | None, more: str = "") -> str:
    """Return the features of a layout with their units, in Markdown; `more` if it is None."""
    if layout is None:
        return more
    return f"{layout.size} numbers: " + ", ".join(f"`{feature}`" for feature in layout)


def readme(
    repo: str,
    tags: list[str],
    lead: str,
    rows: dict[str, object],
    layouts: dict[str, str],
    command: str,
    usage: str,
) -> str:
    """Return a README for the Hub, with a YAML header."""
    cells = {name: " ".join(str(value).replace("|", "\\|").split()) for name, value in rows.items()}
    table = "\n".join(f"| {name} | {cell} |" for name, cell in cells.items())
    parts = [
        "---\nlibrary_name: shapechanger\ntags:\n"
        + "".join(f"- {tag}\n" for tag in ("shapechanger", "robotics", *tags))
        + "---",
        f"# {repo}",
        lead,
        f"| | |\n| --- | --- |\n{table}",
        *(f"**{name}**: {features}" for name, features in layouts.items()),
    ]
    for title, code in (("Made by", command), ("Use it", usage)):
        if code:
            parts += [title, indent(code, "    ")]
    return "\n\n".join(parts) + "\n"


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def push(folder: Path, card: str, repo: str, kind: Kind, *, public: bool = False) -> str:
    """Upload a folder, replacing an earlier push, and return the address of the commit.

    `card` describes the files, in Markdown; the card and the list are added to the folder. A
    repository, such as "ada/ant", is created if it does not exist, and only its owner can read it
    unless it is `public`. Raises HubError if it contains files but no list.
    """
    repo_type = _TYPES[kind]
    files = {
        str(path.relative_to(folder)): _File(path.stat().st_size, sha256_of(path))
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
    listed = _Listed(kind, files, _FORMAT, version("shapechanger"))
    (folder / _CARD).write_bytes(card.encode(errors="replace"))
    (folder / _LIST).write_bytes(msgspec.json.format(msgspec.json.encode(listed), indent=1))
    with _hub(repo, kind) as hub:
        api = hub.HfApi()
        api.create_repo(repo, repo_type=repo_type, private=not public, exist_ok=True)
        found = api.repo_info(repo, repo_type=repo_type).siblings or ()
        strange = {file.rfilename for file in found} - {".gitattributes", _CARD}
        if strange and _LIST not in strange:
            raise HubError(
                f"{repo} contains files that Shapechanger did not push, such as {min(strange)}: "
                "choose another name."
            )
        done = api.upload_folder(
            repo_id=repo,
            folder_path=folder,
            repo_type=repo_type,
            delete_patterns=[_PLACES[kind], f"{_PLACES[kind]}/*"],
            commit_message=f"Push {kind} with Shapechanger",
        )
        return str(done.commit_url)


def pull(repo: str, kind: Kind, folder: Path, *, revision: str = "", max_bytes: int) -> str:
    """Download the files of a push, check them, and return the commit that was pulled.

    `revision` is a commit, branch or tag; "" for the newest commit. Raises HubError if the files
    differ from the repository's list, are of another kind, or have more than `max_bytes` together.
    After an error, `folder`, which must exist, may contain incomplete files.
    """
    repo_type = _TYPES[kind]
    with _hub(repo, kind) as hub:
        found = hub.HfApi().repo_info(
            repo, repo_type=repo_type, revision=revision or None, files_metadata=True
        )
        sizes = {file.rfilename: file.size or 0 for file in found.siblings or ()}
        if not 0 < sizes.get(_LIST, 0) <= _MAX_LIST_BYTES:
            raise HubError(f"{repo} has no {_LIST}, so Shapechanger did not push it.")

        where = {"repo_type": repo_type, "revision": found.sha, "local_dir": folder}
        fetch = partial(hub.hf_hub_download, repo, **where)
        fetch(_LIST)
        listed = _listed((folder / _LIST).read_bytes(), repo, kind)
        held = {name for name in sizes if name.split("/")[0] == _PLACES[kind]}
        if odd := sorted(held ^ listed.keys()):
            raise HubError(f"{repo} has other files than its {_LIST} names: {odd[0][:80]!r}.")
        if (total := sum(sizes[name] for name in listed)) > max_bytes:
            raise HubError(
                f"The files of {repo} have {total} bytes, more than the limit of {max_bytes}."
            )
        # An interrupted `snapshot_download` would wait for its threads.
        with ThreadPool(_TRANSFERS) as pool:
            for _ in pool.imap_unordered(fetch, listed):
                pass
        for name, about in listed.items():
            if sha256_of(folder / name) != about.sha256:
                raise HubError(
                    f"{name} of {repo} does not have the SHA-256 in {_LIST}: it was changed."
                )
    return str(found.sha)


def _listed(content: bytes, repo: str, kind: Kind) -> dict[str, _File]:
    try:
        listed = msgspec.json.decode(content, type=_Listed)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        listed = _Listed()
    if not listed.files or (listed.format, listed.kind) != (_FORMAT, kind):
        raise HubError(f"{_LIST} of {repo} does not list files of {kind} in format {_FORMAT}.")
    if strange := [name for name in listed.files if not _NAMES[kind].fullmatch(name)]:
        raise HubError(f"{_LIST} of {repo} names {strange[0][:80]!r}, which is no {kind} file.")
    return listed.files


@contextmanager
def _hub(repo: str, kind: Kind) -> Generator[Any]:
    """Import huggingface_hub, and convert its errors to HubErrors."""
    no_name = f"{repo!r} is no name of a repository: give owner and name, such as ada/ant."
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repo, re.ASCII):
        raise HubError(no_name)
    with needing_extra("hub"):
        hub = import_module("huggingface_hub")
    # Warnings and progress bars of huggingface_hub would clutter messages.
    utilities, errors = map(import_module, ("huggingface_hub.utils", "huggingface_hub.errors"))
    utilities.logging.set_verbosity_error()
    utilities.disable_progress_bars()
    try:
        yield hub
    except ShapechangerError:
        raise
    except PermissionError as error:
        raise OutputError(f"Cannot write {error.filename}: {error.strerror}.") from error
    except Exception as error:  # Classes of connection errors depend on the version.
        code = getattr(getattr(error, "response", None), "status_code", 0)
        if isinstance(error, errors.HFValidationError):
            text = no_name
        elif isinstance(error, errors.RevisionNotFoundError):
            text = f"{repo} has no such revision."
        elif isinstance(error, errors.RepositoryNotFoundError):
            text = f"There is no {_TYPES[kind]} {repo} on the Hub, or it is private: {_LOG_IN}."
        elif code in (401, 403):
            text = f"The Hub forbids this for {repo}: {_LOG_IN}, with a token that may write to it."
        else:
            text = f"The Hub failed for {repo} ({code or type(error).__name__}): try again."
        raise HubError(text) from error
