"""A local stand-in for the HTTP interface of the Hugging Face Hub, as huggingface_hub uses it."""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import re
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import unquote, urlsplit

OWNER = "hf_owner"  # Token that may write.
READER = "hf_reader"  # Token that may read only.


@dataclass
class Repository:
    """A repository.

    Attributes:
        private: Whether only its owner can see it.
        commits: Files of each commit, by the hash of the commit, oldest first.
    """

    private: bool = False
    commits: dict[str, dict[str, bytes]] = field(default_factory=dict)

    @property
    def files(self) -> dict[str, bytes]:
        """Files of the newest commit."""
        return next(reversed(self.commits.values()), {})

    def commit(self, files: dict[str, bytes]) -> str:
        """Add a commit; return its hash."""
        text = repr((len(self.commits), sorted(files.items()))).encode()
        sha = hashlib.sha1(text).hexdigest()
        self.commits[sha] = files
        return sha


class FakeHub(ThreadingHTTPServer):
    """The server.

    Attributes:
        repositories: Repositories by their type and name, such as "models/ada/ant".
        requests: Method and path of each request.
        cut: Number of bytes after which transfers of a file end, by its name.
        stalled: Names of files whose transfers stop half-way until the server ends.
        stalling: Whether such a transfer is under way.
    """

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.repositories: dict[str, Repository] = {}
        self.requests: list[str] = []
        self.cut: dict[str, int] = {}
        self.stalled: set[str] = set()
        self.stalling = threading.Event()
        self.released = threading.Event()

    @property
    def address(self) -> str:
        """Its URL, for HF_ENDPOINT."""
        return f"http://127.0.0.1:{self.server_address[1]}"


@contextlib.contextmanager
def serve_hub() -> Iterator[FakeHub]:
    """Serve an empty Hub on a free port."""
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
        """Return a repository that the client may see; else answer like the Hub."""
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
