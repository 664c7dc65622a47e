"""Key and certificate of a robot: making, storing and reading them."""

from __future__ import annotations

import contextlib
import datetime
import os
import ssl
import stat
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError, OutputError, RobotError, translate_errors
from shapechanger.files import write_new
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.link.address import is_loopback
from shapechanger.robot.link.authentication import fingerprint_of, is_proof, new_key, parse_key
from shapechanger.robot.link.messages import Hello

_KEY: Final = "key"
_CERTIFICATE: Final = "certificate.pem"
_PRIVATE_KEY: Final = "certificate.key"
_YEARS: Final = 10
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True, slots=True)
class Credentials:
    """Key and certificate that identify a robot to its clients."""

    folder: Path  # Folder of the files of key and certificate.
    # Key that clients must prove to have, as letters and digits; kept out of logs.
    key: str = field(repr=False)
    fingerprint: bytes  # SHA-256 of the certificate (DER).

    def tls(self) -> ssl.SSLContext:
        """Return the server's context for TLS 1.3 or newer."""
        certificate, private_key = self.folder / _CERTIFICATE, self.folder / _PRIVATE_KEY
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        text = f"{certificate} and {private_key} do not match"
        with translate_errors(OSError, to=lambda error: RobotError(f"{text}: {error}.")):
            context.load_cert_chain(certificate, private_key)
        return context


@dataclass(frozen=True, slots=True)
class Authenticator:
    """Checks that a client holds the robot's key."""

    # The key, kept out of logs; empty to accept every client.
    key: bytes = field(default=b"", repr=False)
    certificate: bytes = b""  # Fingerprint of the certificate; empty without TLS.

    @property
    def is_open(self) -> bool:
        """True if the robot has no key and accepts every client."""
        return not self.key

    def accepts(self, hello: Hello, nonce: bytes) -> bool:
        """Return True if the proof in `hello` answers `nonce` with the right key."""
        if self.is_open:
            return True
        return is_proof(hello.proof, self.key, nonce, self.certificate, hello.role)


def credentials_folder(name: str) -> Path:
    """Return the folder of a robot's credentials."""
    if not name or name.startswith(".") or "/" in name or "\0" in name:
        raise RobotError(f"A robot's name must be a valid folder name, got {name!r}.")
    return user_folder("XDG_CONFIG_HOME", ".config") / "robots" / name


def user_folder(variable: str, default: str) -> Path:
    """Return Shapechanger's folder in an XDG base directory; a relative `variable` is ignored."""
    path = os.environ.get(variable, "")
    return (Path(path) if path.startswith("/") else Path.home() / default) / "shapechanger"


def make_credentials(folder: Path, name: str) -> Credentials:
    """Make a key and a self-signed certificate that is valid for ten years.

    Existing credentials are kept, because clients have stored them.
    """
    files = [folder / part for part in (_KEY, _PRIVATE_KEY, _CERTIFICATE)]
    if all(file.exists() for file in files):
        return load_credentials(folder)
    if any(file.exists() for file in files):
        raise RobotError(
            f"{folder} holds only some of the credentials. Move them away, and run "
            "`shapechanger robot init` again."
        )
    certificate, private_key = _self_signed(name)
    contents = ((new_key() + "\n").encode(), private_key, certificate)
    with (
        translate_errors(
            OSError,
            to=lambda error: OutputError(f"Cannot write the credentials to {folder}: {error}."),
        ),
        contextlib.ExitStack() as undo,
    ):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        for file, content, mode in zip(files, contents, (0o600, 0o600, 0o644), strict=True):
            # If a write fails, as on a full disk, partial credentials would block the next attempt.
            undo.callback(file.unlink, missing_ok=True)
            write_new(file, content, mode)
        undo.pop_all()
    return load_credentials(folder)


def load_credentials(folder: Path) -> Credentials:
    """Read and check the credentials in a folder."""
    for file in (folder / _KEY, folder / _PRIVATE_KEY):
        with _readable(file):
            mode = file.stat().st_mode
        if mode & _OTHERS:
            raise RobotError(
                f"Other users can access {file}. Run `chmod 600 {file}`, or better, make a new key."
            )
    with _readable(folder / _KEY):
        key = (folder / _KEY).read_text().strip()
        parse_key(key)
    with _readable(folder / _CERTIFICATE):
        der = ssl.PEM_cert_to_DER_cert((folder / _CERTIFICATE).read_text().strip())
    return Credentials(folder, key, fingerprint_of(der))


def check_exposure(plan: DaemonPlan) -> None:
    """Refuse to serve other machines without credentials, unless `insecure` is set."""
    if not (plan.credentials or plan.insecure or is_loopback(plan.host)):
        raise RobotError(
            f"Other machines reach {plan.host}, and could drive the robot without a key. Run "
            "`shapechanger robot init`, listen at 127.0.0.1, or pass `--insecure`."
        )


def _readable(file: Path) -> contextlib.AbstractContextManager[None]:
    """Refuse a file that is missing or cannot be read."""

    def refusal(error: Exception) -> RobotError:
        if isinstance(error, FileNotFoundError):
            return RobotError(f"{file} does not exist. Run `shapechanger robot init` to make it.")
        return RobotError(f"Cannot read {file}: {str(error).rstrip('.')}.")

    return translate_errors(OSError, ValueError, LinkError, to=refusal)


def _self_signed(name: str) -> tuple[bytes, bytes]:
    """Return a certificate and its private key, both PEM."""
    # Imported only here, because the import takes 10 MB, and the daemon does not need it.
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    private_key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    # The clock of a Pi without a battery may be in the past, so the validity starts early.
    begin = datetime.datetime(2020, 1, 1, tzinfo=datetime.UTC)
    now = max(begin, datetime.datetime.now(datetime.UTC))
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(private_key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(now + datetime.timedelta(days=365 * _YEARS))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .sign(private_key, hashes.SHA256())
    )
    return certificate.public_bytes(serialization.Encoding.PEM), private_key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
