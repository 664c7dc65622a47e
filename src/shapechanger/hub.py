"""Policies and demonstrations on the Hugging Face Hub.

A repository that was pushed has a card for people (`README.md`), the files, and `shapechanger.json`
with the size and the SHA-256 of each file. A pull takes only files that this list names, of the
kind that was asked for, and checks them; whatever else lies in the repository is left there. Files
of the kind "policy" are models on the Hub, "demonstrations" datasets.

The login is that of `huggingface_hub`: `hf auth login`, or the variable HF_TOKEN. No message of
this module repeats one of another package, which might hold the token.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, Literal, cast

from shapechanger.errors import HubError, MissingExtra, OutputError, ShapechangerError

Kind = Literal["policy", "demonstrations"]

POLICY: Final = "policy.safetensors"
"""Name of the file of a policy."""

EPISODES: Final = "episodes"
"""Folder of the archives of episodes."""

_LIST: Final = "shapechanger.json"
_CARD: Final = "README.md"
_FORMAT: Final = 1
_TYPES: Final[dict[Kind, str]] = {"policy": "model", "demonstrations": "dataset"}
_NAMES: Final[dict[Kind, re.Pattern[str]]] = {
    "policy": re.compile(re.escape(POLICY)),
    "demonstrations": re.compile(EPISODES + r"/\w[\w.-]{0,127}\.tar", re.ASCII),
}
_MAX_LIST_BYTES: Final = 16 << 20
_CHUNK: Final = 1 << 20
_UNAUTHORIZED: Final = 401
_FORBIDDEN: Final = 403
_LOG_IN: Final = "log in with `hf auth login`, or set HF_TOKEN"


@dataclass(frozen=True, slots=True)
class Pulled:
    """Result of a pull.

    Attributes:
        revision: Commit that was pulled.
        paths: The files, in the order of their names.
    """

    revision: str
    paths: tuple[Path, ...]


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def push(
    files: Mapping[str, Path], card: str, repo: str, kind: Kind, *, public: bool = False
) -> str:
    """Upload files in one commit, in place of those of an earlier push.

    Args:
        files: The files, by their names in the repository.
        card: What they are, in Markdown.
        repo: Name of the repository, such as "ada/ant"; it is made if there is none.
        kind: Kind of the files.
        public: Whether a new repository can be read by everybody.

    Returns:
        Address of the commit.

    Raises:
        HubError: If the Hub refuses, or the repository holds something else.
        MissingExtra: If huggingface_hub is not installed.
    """
    hub, errors = _library(), _errors()
    _require_name(repo)
    repo_type = _TYPES[kind]
    about = {
        name: {"bytes": path.stat().st_size, "sha256": sha256_of(path)}
        for name, path in files.items()
    }
    listed = {"format": _FORMAT, "kind": kind, "version": version("shapechanger"), "files": about}
    with _answers(repo, kind):
        api = hub.HfApi()
        try:
            found = api.repo_info(repo, repo_type=repo_type)
            there = {file.rfilename for file in found.siblings or ()}
        except errors.RepositoryNotFoundError:
            api.create_repo(repo, repo_type=repo_type, private=not public, exist_ok=True)
            there = set[str]()
        strange = there - {".gitattributes", _CARD}
        if strange and _LIST not in there:
            raise HubError(
                f"{repo} holds files that Shapechanger did not push, such as {min(strange)}: "
                "choose another name."
            )
        add = hub.CommitOperationAdd
        operations: list[Any] = [add(name, str(path)) for name, path in files.items()]
        operations.append(add(_CARD, card.encode(errors="replace")))
        operations.append(add(_LIST, json.dumps(listed, indent=1).encode()))
        gone = sorted(name for name in there - files.keys() if _NAMES[kind].fullmatch(name))
        operations += [hub.CommitOperationDelete(name) for name in gone]
        done = api.create_commit(
            repo,
            operations,
            commit_message=f"Push {kind} with Shapechanger",
            repo_type=repo_type,
        )
        return str(done.commit_url)


def pull(repo: str, kind: Kind, folder: Path, *, revision: str = "", max_bytes: int) -> Pulled:
    """Download the files of a push, and check their sizes and hashes.

    Args:
        repo: Name of the repository, such as "ada/ant".
        kind: Kind of its files.
        folder: An existing folder to write to; it may hold parts of files after an error.
        revision: Commit, branch or tag; "" for the newest commit.
        max_bytes: Largest size of all files together.

    Raises:
        HubError: If the Hub refuses, or the files are not those that the repository lists, are of
            another kind, or larger.
        OutputError: If the folder cannot be written to.
        MissingExtra: If huggingface_hub is not installed.
    """
    hub = _library()
    _require_name(repo)
    repo_type = _TYPES[kind]
    with _answers(repo, kind):
        found = hub.HfApi().repo_info(repo, repo_type=repo_type, revision=revision or None)
        commit = str(found.sha)
        if _LIST not in {file.rfilename for file in found.siblings or ()}:
            raise HubError(f"{repo} has no {_LIST}, so Shapechanger did not push it.")
        prefix = "datasets/" if repo_type == "dataset" else ""
        files = hub.HfFileSystem(skip_instance_cache=True)

        def chunks(name: str) -> Generator[bytes]:
            # A stream: nothing is fetched that is not asked for, whatever its size is said to be.
            with files.open(f"{prefix}{repo}@{commit}/{name}", block_size=0) as file:
                while chunk := cast("bytes", file.read(_CHUNK)):
                    yield chunk

        listed = _listed(_read_list(chunks(_LIST), repo), repo, kind, max_bytes)
        paths: list[Path] = []
        for name, (size, digest) in sorted(listed.items()):
            path = folder / name
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                file = path.open("xb")
            except OSError as error:
                raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
            with file:
                _fetch(chunks(name), file, f"{name} of {repo}", size, digest)
            paths.append(path)
    return Pulled(commit, tuple(paths))


def _require_name(repo: str) -> None:
    """Refuse a name without an owner, an address, or a path."""
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repo, re.ASCII):
        raise _no_name(repo)


def _no_name(repo: str) -> HubError:
    return HubError(
        f"{repo!r} is no name of a repository: give its owner and its name, such as ada/ant."
    )


def _fetch(chunks: Generator[bytes], file: Any, name: str, size: int, digest: str) -> None:
    """Write what comes to a file, and refuse what was not listed."""
    found, got = hashlib.sha256(), 0
    for chunk in chunks:
        got += len(chunk)
        if got > size:
            chunks.close()
            raise HubError(f"{name} is larger than the {size} bytes that {_LIST} says.")
        found.update(chunk)
        try:
            file.write(chunk)
        except OSError as error:
            raise OutputError(f"Cannot write {file.name}: {error.strerror or error}.") from error
    if got < size:
        raise HubError(f"The transfer of {name} was cut after {got} of {size} bytes: try again.")
    if found.hexdigest() != digest:
        raise HubError(f"{name} does not have the SHA-256 that {_LIST} says: it was changed.")


def _read_list(chunks: Generator[bytes], repo: str) -> Any:
    content = b""
    for chunk in chunks:
        content += chunk
        if len(content) > _MAX_LIST_BYTES:
            chunks.close()
            raise HubError(f"{_LIST} of {repo} has more than {_MAX_LIST_BYTES} bytes.")
    try:
        return json.loads(content)
    except (ValueError, RecursionError) as error:
        raise HubError(f"{_LIST} of {repo} is not valid JSON.") from error


def _listed(plain: Any, repo: str, kind: Kind, max_bytes: int) -> dict[str, tuple[int, str]]:
    """Return the size and the SHA-256 of each file that a repository lists."""
    fields = cast("dict[str, Any]", plain) if isinstance(plain, dict) else {}
    if fields.get("format") != _FORMAT:
        raise HubError(f"{repo} was pushed by another version of Shapechanger.")
    if fields.get("kind") != kind:
        raise HubError(f"{repo} holds {str(fields.get('kind'))[:40]!r}, and not {kind!r}.")
    listed: dict[str, tuple[int, str]] = {}
    try:
        for name, about in fields["files"].items():
            listed[name] = int(about["bytes"]), str(about["sha256"])
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise HubError(f"{_LIST} of {repo} does not list its files.") from error
    for name in listed:
        if not _NAMES[kind].fullmatch(name):
            raise HubError(f"{_LIST} of {repo} names {name[:80]!r}, which is no {kind} file.")
    sizes = [size for size, _ in listed.values()]
    if not sizes or min(sizes) < 0:
        raise HubError(f"{_LIST} of {repo} does not list its files.")
    if sum(sizes) > max_bytes:
        raise HubError(
            f"The files of {repo} have {sum(sizes)} bytes, more than the limit of {max_bytes}."
        )
    return listed


def _library() -> Any:
    try:
        hub = import_module("huggingface_hub")
    except ImportError as error:
        raise MissingExtra("huggingface_hub", "hub") from error
    # Our errors are one sentence, and its warnings would stand beside it.
    utilities = import_module("huggingface_hub.utils")
    utilities.logging.set_verbosity_error()
    utilities.disable_progress_bars()
    return hub


def _errors() -> Any:
    return import_module("huggingface_hub.errors")


@contextmanager
def _answers(repo: str, kind: Kind) -> Generator[None]:
    """Turn what the Hub answers, and errors of the transport, into sentences."""
    errors = _errors()
    try:
        yield
    except ShapechangerError:
        raise
    except errors.HFValidationError as error:
        raise _no_name(repo) from error
    except errors.RevisionNotFoundError as error:
        raise HubError(f"{repo} has no such revision.") from error
    except errors.RepositoryNotFoundError as error:
        raise HubError(
            f"There is no {_TYPES[kind]} {repo} on the Hub, or it is private: check the name, and "
            f"{_LOG_IN}."
        ) from error
    except errors.HfHubHTTPError as error:
        code = getattr(error.response, "status_code", 0)
        if code == _UNAUTHORIZED:
            raise HubError(f"The Hub wants to know who asks for {repo}: {_LOG_IN}.") from error
        if code == _FORBIDDEN:
            raise HubError(
                f"The Hub forbids this for {repo}: use a token that may write to it."
            ) from error
        raise HubError(f"The Hub answered {code} for {repo}: try again later.") from error
    except Exception as error:  # Of the transport, whose package differs between versions.
        raise HubError(
            f"The connection to the Hub failed ({type(error).__name__}): try again."
        ) from error
