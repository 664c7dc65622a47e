"""`hub push | pull` of policies and recordings, with a fake Hub on this machine."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import pickle
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest

from shapechanger.demos.episodes import Drop, edit
from shapechanger.finger.task import POLICIES
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.demos.exchange.small import all_of, content_of, drive

pytestmark = [pytest.mark.system, pytest.mark.realtime]

PROGRAM = "from shapechanger.cli import main; main()"

# Runs commands one after another, because each start takes seconds.
PROGRAMS = """
import contextlib, io, json, os, sys
from shapechanger.cli import main

for line in sys.stdin:
    arguments, os.environ["HF_TOKEN"] = json.loads(line)
    output, errors, code = io.StringIO(), io.StringIO(), 0
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            main(arguments)
        except SystemExit as stop:
            code = stop.code
    print(json.dumps([code, output.getvalue(), errors.getvalue()]), flush=True)
"""
POLICY = POLICIES["reach"]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def served() -> Iterator[FakeHub]:
    with serve_hub() as server:
        yield server


@pytest.fixture
def hub(served: FakeHub) -> FakeHub:
    for state in (served.repositories, served.requests, served.cut, served.stalled):
        state.clear()
    served.stalling.clear()
    served.released.clear()
    return served


@pytest.fixture(scope="module")
def environment(served: FakeHub, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Environment variables of a process that uses the fake Hub, without the machine's login."""
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("HF_")}
    return inherited | {
        "HF_ENDPOINT": served.address,
        "HF_HOME": str(tmp_path_factory.mktemp("home")),
        "HF_TOKEN": OWNER,
        "HF_HUB_DISABLE_XET": "1",
        "NO_PROXY": "127.0.0.1",
    }


@pytest.fixture(scope="module")
def run(environment: dict[str, str]) -> Iterator[Run]:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAMS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:

        def command(*arguments: object, token: str = OWNER) -> tuple[int, str, str]:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(json.dumps([[*map(str, arguments)], token]) + "\n")
            process.stdin.flush()
            code, output, errors = json.loads(process.stdout.readline())
            assert OWNER not in output + errors
            return code, output, errors

        yield command
        process.kill()


def refused(answer: tuple[int, str, str]) -> str:
    code, output, errors = answer
    assert code == 2, errors
    assert output == ""
    assert errors.startswith("error: ")
    assert errors.endswith(".\n")
    assert errors.count("\n") == 1
    return errors


@pytest.mark.parametrize("file", [POLICY, CLONES["car"]])
def test_a_policy_is_pushed_and_pulled(run: Run, hub: FakeHub, tmp_path: Path, file: Path) -> None:
    code, output, errors = run("hub", "push", file, "ada/reach")
    assert (code, errors) == (0, "")
    assert f"{hub.address}/ada/reach/commit/" in output
    repository = hub.repositories["models/ada/reach"]
    assert repository.private
    assert set(repository.files) == {"README.md", "shapechanger.json", "policy.safetensors"}
    card = repository.files["README.md"].decode()
    listed = json.loads(repository.files["shapechanger.json"])["files"]["policy.safetensors"]
    for part in ("library_name: shapechanger", "**Action**", listed["sha256"], "hub pull"):
        assert part in card
    # Other files of the repository are not downloaded.
    first = next(iter(repository.commits))
    repository.commit(repository.files | {"evil.pkl": pickle.dumps(print)})
    out = tmp_path / "pulled.safetensors"
    code, output, errors = run("hub", "pull", "ada/reach", "--out", out)
    assert (code, errors) == (0, "")
    assert out.read_bytes() == file.read_bytes()
    assert next(reversed(repository.commits)) in output
    assert not any("evil" in request for request in hub.requests)
    pinned = ("--out", tmp_path / "folder" / "pinned.safetensors", "--revision", first)
    assert first in run("hub", "pull", "ada/reach", *pinned)[1]
    assert "exists already" in refused(run("hub", "pull", "ada/reach", "--out", out))
    for arguments in (("push", "a.onnx", "ada/reach"), ("pull", "ada/reach", "--out", "a.onnx")):
        assert "would be ONNX" in refused(run("hub", *arguments))


def test_demonstrations_are_pushed_and_pulled(run: Run, hub: FakeHub, tmp_path: Path) -> None:
    """Pulled episodes are identical, with dropped steps; a second push replaces the first."""
    edit(drive(tmp_path / "data", 5), Drop(1, 2, "bad"))
    second = drive(tmp_path / "data", 3)
    assert run("hub", "push", tmp_path / "data", "ada/drive", "--public")[0] == 0
    repository = hub.repositories["datasets/ada/drive"]
    assert not repository.private
    card = repository.files["README.md"].decode()
    assert "`speed [m/s]`" in card
    assert "| episodes | 2 |" in card
    code, output, _ = run("hub", "pull", "ada/drive", "--out", tmp_path / "back")
    assert code == 0
    assert "2 episodes, 8 steps" in output
    before, after = all_of(tmp_path / "data"), all_of(tmp_path / "back")
    assert [e.path.name for e in after] == [e.path.name for e in before]
    assert [content_of(e) for e in after] == [content_of(e) for e in before]
    assert {path.name for path in (tmp_path / "back").iterdir()} == {e.path.name for e in before}
    assert run("hub", "push", second, "ada/drive")[0] == 0
    names = {name.split("/")[1] for name in repository.files if name.startswith("episodes/")}
    assert names == {second.name}


def test_refusals_give_one_sentence(run: Run, hub: FakeHub, tmp_path: Path) -> None:
    out = tmp_path / "out.safetensors"
    pull = ("hub", "pull", "ada/none", "--out", out)
    push = ("hub", "push", POLICY, "ada/new")
    assert "no model ada/none on the Hub, or it is private" in refused(run(*pull))
    assert "hf auth login" in refused(run(*pull, token=""))
    for token in ("", READER):
        assert "forbids this for ada/new" in refused(run(*push, token=token))
    # A token that is invalid in an HTTP header must not be part of the error.
    answer = run(*push, token="hf_söcret")
    assert "söcret" not in refused(answer)
    for name in ("ant", "https://huggingface.co/ada/ant", "ada/-ant"):
        assert "no name of a repository" in refused(run("hub", "pull", name, "--out", out))
    hub.repositories["models/ada/other"] = Repository()
    hub.repositories["models/ada/other"].commit({"model.bin": b"1"})
    other = run("hub", "push", POLICY, "ada/other")
    assert "did not push, such as model.bin" in refused(other)
    pull = ("hub", "pull", "ada/other", "--out", out)
    assert "has no shapechanger.json" in refused(run(*pull))
    assert "no such revision" in refused(run(*pull, "--revision", "v9"))
    assert list(tmp_path.iterdir()) == []


def listing(files: dict[str, bytes], kind: str = "policy") -> bytes:
    about = {
        name: {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
        for name, content in files.items()
    }
    return json.dumps({"format": 1, "kind": kind, "files": about}).encode()


def episodes(*names: str) -> dict[str, bytes]:
    return {f"episodes/{name}": b"x" for name in names}


DEMOS = "demonstrations"
FILE = "out.safetensors"
ABC = {"policy.safetensors": b"abc"}
STEPS, EVIL = episodes("one/steps.jsonl"), episodes("../../evil")


@pytest.mark.parametrize(
    ("out", "held", "listed", "message"),
    [
        (FILE, ABC, listing({"policy.safetensors": b"xy"}), "does not have the SHA-256"),
        (FILE, ABC, listing({"model.pkl": b"abc"}), "'model.pkl', which is no policy file"),
        (FILE, ABC, listing(ABC, DEMOS), "does not list files of policy"),
        (FILE, ABC, b'{"format": 2}', "does not list files of policy in format 1"),
        (FILE, ABC, b"[" * 10**6, "does not list files of policy"),
        (FILE, ABC, listing(ABC), "policy.safetensors of ada/x is not a policy"),
        ("out", EVIL, listing(EVIL, DEMOS), "evil', which is no demonstrations file"),
        ("out", STEPS | episodes("one/x.pkl"), listing(STEPS, DEMOS), "'episodes/one/x.pkl'"),
        ("out", STEPS, listing(STEPS, DEMOS), "is not an episode"),
        ("out", {}, listing(STEPS, DEMOS), "has other files than its shapechanger.json names"),
    ],
)
def test_repositories_with_unexpected_files_are_refused(
    run: Run,
    hub: FakeHub,
    tmp_path: Path,
    out: str,
    held: dict[str, bytes],
    listed: bytes,
    message: str,
) -> None:
    kind = "datasets" if out == "out" else "models"
    repository = hub.repositories[f"{kind}/ada/x"] = Repository()
    repository.commit({**held, "shapechanger.json": listed})
    assert message in refused(run("hub", "pull", "ada/x", "--out", tmp_path / out))
    assert list(tmp_path.iterdir()) == []


def test_a_pull_that_is_too_large_or_interrupted_leaves_nothing(
    run: Run, hub: FakeHub, environment: dict[str, str], tmp_path: Path
) -> None:
    drive(tmp_path / "data", 3)
    assert run("hub", "push", tmp_path / "data", "ada/drive")[0] == 0
    hub.cut["shapechanger.json"] = 10
    cut = ("hub", "pull", "ada/drive", "--out", tmp_path / "out")
    assert "The Hub failed for ada/drive" in refused(run(*cut))
    hub.cut.clear()
    hub.requests.clear()
    pull = ("hub", "pull", "ada/drive", "--out", tmp_path / "out", "--max-gib", "1e-9")
    assert "more than the limit of 1" in refused(run(*pull))
    assert not any("episodes" in request for request in hub.requests)
    names = hub.repositories["datasets/ada/drive"].files
    hub.stalled.update(name for name in names if name.endswith(".jsonl"))
    before = {path.name for path in tmp_path.iterdir()}
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM, "hub", "pull", "ada/drive", "--out", "out"],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert hub.stalling.wait(60.0)
        process.send_signal(signal.SIGINT)
        try:
            errors = process.communicate(timeout=20.0)[1]
        finally:
            hub.released.set()
    assert (process.returncode, errors) == (130, "Stopped.\n")
    assert {path.name for path in tmp_path.iterdir()} == before


OWNER = "hf_owner"  # Token that may write.
READER = "hf_reader"  # Token that may read only.


@dataclass
class Repository:
    """A repository, with the files of each commit keyed by its hash, oldest first."""

    private: bool = False
    commits: dict[str, dict[str, bytes]] = field(default_factory=dict)

    @property
    def files(self) -> dict[str, bytes]:
        return next(reversed(self.commits.values()), {})

    def commit(self, files: dict[str, bytes]) -> str:
        text = repr((len(self.commits), sorted(files.items()))).encode()
        sha = hashlib.sha1(text).hexdigest()
        self.commits[sha] = files
        return sha


class FakeHub(ThreadingHTTPServer):
    """A Hub on this machine."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repositories: dict[str, Repository] = {}  # Keyed by name, such as "models/ada/ant".
        self.requests: list[str] = []  # Methods and paths.
        self.cut: dict[str, int] = {}  # Bytes after which the transfer of a file ends.
        self.stalled: set[str] = set()  # Files whose transfers stop half-way until `released`.
        self.stalling = threading.Event()  # Set once such a transfer has stopped.
        self.released = threading.Event()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


@contextlib.contextmanager
def serve_hub() -> Iterator[FakeHub]:
    with FakeHub() as hub:
        thread = threading.Thread(target=hub.serve_forever, daemon=True)
        thread.start()
        yield hub
        hub.shutdown()


class _Handler(BaseHTTPRequestHandler):
    server: FakeHub
    protocol_version = "HTTP/1.1"

    def log_message(self, *_: object) -> None:
        """Print nothing."""

    def _answer(self) -> None:
        self._body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        path = unquote(urlsplit(self.path).path)
        self.server.requests.append(f"{self.command} {path}")
        for pattern, method in _ROUTES:
            if match := re.fullmatch(pattern, f"{self.command} {path}"):
                getattr(self, method)(*match.groups())
                return
        self._send(501, {"error": f"The fake has no {self.command} {path}."})

    do_HEAD = do_GET = do_POST = _answer

    def _send(self, code: int, answer: Any, **headers: str) -> None:
        body = json.dumps(answer).encode()
        self.send_response(code)
        for name, value in headers.items():
            self.send_header(name.replace("_", "-"), value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    @property
    def _token(self) -> str:
        return self.headers.get("Authorization", "").removeprefix("Bearer ")

    def _may_write(self) -> bool:
        if self._token == OWNER:
            return True
        self._send(403 if self._token == READER else 401, {"error": "no"})
        return False

    def _repository(self, name: str) -> Repository | None:
        """Return a repository, or send an error and return None if the client may not see it."""
        found = self.server.repositories.get(name)
        if self._token not in {"", OWNER, READER}:
            self._send(401, {"error": "no"}, X_Error_Message="Invalid credentials in"
                       " Authorization header")  # fmt: skip
            return None
        if found is None or (found.private and self._token != OWNER):
            code = 404 if self._token else 401
            self._send(code, {"error": "Repository not found"}, X_Error_Code="RepoNotFound")
            return None
        return found

    def _commit_of(self, found: Repository, revision: str) -> str | None:
        newest = next(reversed(found.commits), "0" * 40)
        if revision in {"main", "", *found.commits}:
            return revision if revision in found.commits else newest
        self._send(404, {"error": "Invalid rev id"}, X_Error_Code="RevisionNotFound")
        return None

    def _create(self) -> None:
        if not self._may_write():
            return
        plain = json.loads(self._body)
        name = f"{plain.get('organization') or 'ada'}/{plain['name']}"
        private = bool(plain.get("private")) or plain.get("visibility") == "private"
        key = f"{plain.get('type') or 'model'}s/{name}"
        self.server.repositories.setdefault(key, Repository(private))
        prefix = "datasets/" if key.startswith("datasets") else ""
        self._send(200, {"url": f"{self.server.address}/{prefix}{name}"})

    def _info(self, name: str, revision: str | None) -> None:
        found = self._repository(name)
        if found is None or (commit := self._commit_of(found, revision or "")) is None:
            return
        files = found.commits.get(commit, {})
        files = {".gitattributes": b""} | files
        siblings = [{"rfilename": name, "size": len(content)} for name, content in files.items()]
        about = {"_id": "0", "id": name.partition("/")[2], "sha": commit, "siblings": siblings}
        self._send(200, about | {"private": found.private, "tags": [], "downloads": 0, "likes": 0})

    def _tree(self, name: str, revision: str) -> None:
        if (found := self._repository(name)) and (commit := self._commit_of(found, revision)):
            about = {"type": "file", "oid": "0"}
            files = found.commits.get(commit, {})
            self._send(200, [about | {"path": p, "size": len(c)} for p, c in files.items()])

    def _validate(self) -> None:
        self._send(200, {"errors": [], "warnings": []})

    def _preupload(self, name: str) -> None:
        if not self._may_write() or self._repository(name) is None:
            return
        about = {"uploadMode": "regular", "shouldIgnore": False, "oid": None}
        files = json.loads(self._body)["files"]
        self._send(200, {"files": [about | {"path": file["path"]} for file in files]})

    def _commit(self, name: str) -> None:
        if not self._may_write() or (found := self._repository(name)) is None:
            return
        files = dict(found.files)
        for line in self._body.splitlines():
            plain = json.loads(line)
            value = plain["value"]
            match plain["key"]:
                case "file":
                    files[value["path"]] = base64.b64decode(value["content"])
                case "deletedFile":
                    del files[value["path"]]
                case _:
                    pass
        sha = found.commit(files)
        url = f"{self.server.address}/{name.removeprefix('models/')}/commit/{sha}"
        self._send(200, {"success": True, "commitUrl": url, "commitOid": sha, "hookOutput": ""})

    def _file(self, prefix: str | None, name: str, revision: str, file: str) -> None:
        found = self._repository(f"{prefix or 'models/'}{name}")
        if found is None or (commit := self._commit_of(found, revision)) is None:
            return
        content = found.commits[commit].get(file)
        if content is None:
            self._send(404, {"error": "Entry not found"}, X_Error_Code="EntryNotFound")
            return
        start = int((self.headers.get("Range") or "bytes=0-")[6:].split("-")[0])
        self.send_response(206 if start else 200)
        self.send_header("X-Repo-Commit", commit)
        self.send_header("ETag", f'"{hashlib.sha256(content).hexdigest()}"')
        self.send_header("Content-Length", str(len(content) - start))
        self.end_headers()
        if self.command == "GET":
            end = self.server.cut.get(file, len(content))
            if file in self.server.stalled:
                end = len(content) // 2
            self.wfile.write(content[start : max(start, end)])
            if file in self.server.stalled:
                self.server.stalling.set()
                self.server.released.wait()
            self.close_connection = end < len(content)


_REPOSITORY = r"((?:models|datasets)/[\w.-]+/[\w.-]+)"
_ROUTES = (
    (r"POST /api/repos/create", "_create"),
    (r"POST /api/validate-yaml", "_validate"),
    (rf"GET /api/{_REPOSITORY}(?:/revision/(.+))?", "_info"),
    (rf"GET /api/{_REPOSITORY}/tree/(\w+)", "_tree"),
    (rf"POST /api/{_REPOSITORY}/preupload/main", "_preupload"),
    (rf"POST /api/{_REPOSITORY}/commit/main", "_commit"),
    (r"(?:GET|HEAD) /(datasets/)?([\w.-]+/[\w.-]+)/resolve/([^/]+)/(.+)", "_file"),
)
