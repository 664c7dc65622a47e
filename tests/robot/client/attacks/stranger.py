"""A client written from docs/wire.md alone: sockets, TLS, WebSocket frames and plain msgpack.

It shares no code with Shapechanger, so that it can also send invalid messages.
"""

import base64
import contextlib
import hashlib
import hmac
import os
import socket
import ssl
import struct
import time
from typing import Any, Self

import msgspec.msgpack

PATIENCE_S = 10.0
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10
PURPOSE = b"shapechanger link 1"


def key_bytes(text: str) -> bytes:
    return base64.b32decode(text.strip().replace("-", "") + "======")


def proof(key: bytes, nonce: bytes, certificate: bytes, role: str) -> bytes:
    parts = (PURPOSE, nonce, certificate, role.encode())
    text = b"".join(struct.pack(">I", len(part)) + part for part in parts)
    return hmac.digest(key, text, "sha256")


def frame(data: bytes, opcode: int = BINARY, *, end: bool = True) -> bytes:
    return header(len(data), opcode, end=end) + data  # The mask is 0.


def header(length: int, opcode: int = BINARY, *, end: bool = True) -> bytes:
    """Return the header of a masked frame that claims `length` bytes."""
    if length < 126:
        size = bytes([length | 128])
    elif length < 2**16:
        size = struct.pack(">BH", 126 | 128, length)
    else:
        size = struct.pack(">BQ", 127 | 128, length)
    return bytes([end << 7 | opcode]) + size + bytes(4)


class Stranger:
    """A connection from `source`, in 127.0.0.0/8, with TLS up to `version`, or plain TCP."""

    def __init__(
        self,
        port: int,
        *,
        source: str = "127.0.0.1",
        version: ssl.TLSVersion | None = ssl.TLSVersion.TLSv1_3,
    ) -> None:
        self.port = port
        self.certificate = b""
        self.nonce = b""
        self.proof = b""
        self.seen: dict[str, Any] = {}
        self._received = b""
        self._socket = socket.create_connection(
            ("127.0.0.1", port), PATIENCE_S, source_address=(source, 0)
        )
        if version is not None:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
            context.maximum_version = version
            try:
                self._socket = context.wrap_socket(self._socket)
            except BaseException:
                self._socket.close()
                raise
            certificate = self._socket.getpeercert(binary_form=True)
            self.certificate = hashlib.sha256(certificate or b"").digest()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    # Bytes.

    def write(self, data: bytes) -> None:
        """Send bytes; do nothing if the robot has closed the connection."""
        with contextlib.suppress(BrokenPipeError, ConnectionResetError, ssl.SSLError):
            self._socket.sendall(data)

    def read(self, count: int) -> bytes:
        while len(self._received) < count and (data := self._some()):
            self._received += data
        data, self._received = self._received[:count], self._received[count:]
        return data

    def rest(self) -> str:
        while data := self._some():
            self._received += data
        return self._received.decode("latin-1")

    @property
    def unread(self) -> bytes:
        self.is_open(0.001)
        return self._received

    def _some(self) -> bytes:
        try:
            return self._socket.recv(65536)
        except (ConnectionResetError, ssl.SSLError):
            return b""

    def is_open(self, wait_s: float = 0.05) -> bool:
        """Read what arrives, and return whether the robot keeps the connection."""
        self._socket.settimeout(wait_s)
        try:
            while data := self._some():
                self._received += data
            return False
        except TimeoutError:
            return True
        finally:
            self._socket.settimeout(PATIENCE_S)

    # HTTP and WebSocket.

    def request(self, text: str, **headers: str) -> str:
        """Send a request line with headers, and return the status line of the answer."""
        lines = {"Host": f"127.0.0.1:{self.port}"} | headers
        lines = {name.replace("_", "-"): value for name, value in lines.items()}
        request = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
        self.write(f"{text}\r\n{request}\r\n".encode("latin-1"))
        return self.answer().partition("\r\n")[0]

    def answer(self) -> str:
        """Return the status line and the headers of an answer; "" without an answer."""
        answer = b""
        while not answer.endswith(b"\r\n\r\n") and (byte := self.read(1)):
            answer += byte
        return answer.decode("latin-1")

    def upgrade(self, path: str = "/link", **headers: str) -> str:
        wanted = {
            "Upgrade": "websocket",
            "Connection": "Upgrade",
            "Sec_WebSocket_Version": "13",
            "Sec_WebSocket_Key": base64.b64encode(os.urandom(16)).decode(),
        }
        return self.request(f"GET {path} HTTP/1.1", **(wanted | headers))

    def receive(self) -> dict[str, Any]:
        """Return the next message of the robot; {} after the connection has closed."""
        until_s = time.monotonic() + PATIENCE_S
        while head := self.read(2):
            length = head[-1] & 127
            if length > 125:
                size = 2 if length == 126 else 8
                length = int.from_bytes(self.read(size), "big")
            data = self.read(length)
            opcode = head[0] & 15
            if opcode == PING:
                self.write(frame(data, PONG))
                if time.monotonic() > until_s:
                    raise AssertionError("The robot sends pings and no message.")
            elif opcode == BINARY:
                return msgspec.msgpack.decode(data)
            elif opcode == CLOSE:
                return {}
        return {}

    def send(self, kind: str, **fields: Any) -> None:
        self.write(frame(msgspec.msgpack.encode({"kind": kind, **fields})))

    def expect(self, kind: str) -> dict[str, Any]:
        while message := self.receive():
            if message["kind"] == kind:
                return message
        raise AssertionError(f"The robot closed the connection without {kind!r}.")

    # The link.

    def challenge(self) -> bytes:
        status = self.upgrade()
        assert "101" in status, status
        self.nonce = self.expect("challenge")["nonce"]
        return self.nonce

    def hello(self, key: bytes, role: str = "program", **fields: Any) -> None:
        nonce = self.challenge()
        self.proof = proof(key, nonce, self.certificate, role)
        self.send("hello", **{"version": 1, "proof": self.proof, "role": role, **fields})

    def enter(self, key: bytes, role: str = "program", **fields: Any) -> dict[str, Any]:
        self.hello(key, role, **fields)
        return self.expect("welcome")

    def observe(self, after: int = 0) -> dict[str, Any]:
        self.send("acknowledge", seq=after)
        self.seen = self.expect("observation")
        return self.seen

    def take(self) -> dict[str, Any]:
        self.send("take")
        return self.expect("lease")

    def arm(self) -> None:
        """Arm the robot and wait until it is armed, which a busy guard may report late."""
        seen = self.observe()
        self.send("arm", answers=seen["seq"], emergency=seen["emergencies"])
        while not seen["armed"]:
            seen = self.observe()

    def control(self, key: bytes, name: str) -> None:
        """Enter as a person, take control once it is free, and arm."""
        self.enter(key, "person", name=name)
        while not self.take()["mine"]:
            pass  # The client of the previous test may still have control.
        self.arm()

    def drive(self, seq: int, *values: float, **fields: Any) -> None:
        answered = {"seq": seq, "answers": self.observe()["seq"]}
        self.send("command", **(answered | fields), values=values)

    def refusal(self) -> str:
        """Return the reason of the next refusal; "closed" if the connection ends without one."""
        while message := self.receive():
            if message["kind"] == "refused":
                return message["reason"]
        return "closed"

    def now_ns(self) -> int:
        self.send("ping", token=1)
        return self.expect("pong")["now_ns"]
