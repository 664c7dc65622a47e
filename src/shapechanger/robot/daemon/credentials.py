"""The key and the certificate of a robot: how they are made, kept and read."""

from __future__ import annotations

import contextlib
import datetime
import os
import ssl
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from shapechanger.errors import LinkError, OutputError, RobotError
from shapechanger.link.address import is_loopback
from shapechanger.link.authentication import fingerprint_of, new_key, parse_key
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.new_file import write_new

__all__ = [
    "Credentials",
    "check_exposure",
    "credentials_folder",
    "load_credentials",
    "make_credentials",
    "read_key",
    "server_tls",
]

_KEY: Final = "key"
_CERTIFICATE: Final = "certificate.pem"
_PRIVATE_KEY: Final = "certificate.key"
_YEARS: Final = 10
_OTHERS: Final = stat.S_IRWXG | stat.S_IRWXO


@dataclass(frozen=True, slots=True)
class Credentials:
    """What makes a robot known to its clients.

    Attributes:
        key_file: File of the key that clients must hold.
        certificate: File of the certificate (PEM).
        private_key: File of its private key (PEM).
        fingerprint: SHA-256 of the certificate (DER).
    """

    key_file: Path
    certificate: Path
    private_key: Path
    fingerprint: bytes


def credentials_folder(name: str) -> Path:
    """Where the credentials of a robot are, by its name.

    Raises:
        RobotError: If the name is no name of a folder.
    """
    if not name or name.startswith(".") or "/" in name or "\0" in name:
        raise RobotError(f"A robot cannot be called {name!r}: its name is that of a folder.")
    config = os.environ.get("XDG_CONFIG_HOME", "")
    # The XDG base directory specification says that a relative path must be ignored.
    base = Path(config) if config.startswith("/") else Path.home() / ".config"
    return base / "shapechanger" / "robots" / name


def make_credentials(folder: Path, name: str) -> Credentials:
    """Make a key and a self-signed certificate that is valid for ten years.

    What is there already stays: clients know it.

    Raises:
        OutputError: If the folder cannot be written.
        RobotError: If half of it is there, or others may read it.
    """
    files = [folder / part for part in (_KEY, _CERTIFICATE, _PRIVATE_KEY)]
    if all(file.exists() for file in files):
        return load_credentials(folder)
    if any(file.exists() for file in files):
        raise RobotError(
            f"Only some of the credentials are in {folder}. "
            "Move them away, and run `shapechanger robot init` again."
        )
    certificate, private_key = _self_signed(name)
    is_new = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_new(folder / _KEY, (new_key() + "\n").encode(), 0o600)
        write_new(folder / _PRIVATE_KEY, private_key, 0o600)
        write_new(folder / _CERTIFICATE, certificate, 0o644)
    except OSError as error:
        # On a full disk, say. Half of them would be in the way of the next try.
        with contextlib.suppress(OSError):
            for file in files:
                file.unlink(missing_ok=True)
            if is_new:
                folder.rmdir()
        raise OutputError(f"The credentials cannot be written to {folder}: {error}.") from error
    return load_credentials(folder)


def load_credentials(folder: Path) -> Credentials:
    """The credentials in a folder.

    Raises:
        RobotError: If one is missing, or is no such thing, or others may read it.
    """
    read_key(folder / _KEY)
    _refuse_others(folder / _PRIVATE_KEY)
    certificate = folder / _CERTIFICATE
    return Credentials(
        key_file=folder / _KEY,
        certificate=certificate,
        private_key=folder / _PRIVATE_KEY,
        fingerprint=_fingerprint(certificate),
    )


def read_key(file: Path) -> bytes:
    """The key in a file.

    Raises:
        RobotError: If it is missing or no key, or others may read it.
    """
    _refuse_others(file)
    try:
        return parse_key(file.read_text())
    except (OSError, UnicodeDecodeError, LinkError) as error:
        raise RobotError(f"The key in {file} cannot be read: {error}") from error


def server_tls(certificate: Path, private_key: Path) -> tuple[ssl.SSLContext, bytes]:
    """What a server speaks TLS with, 1.3 at least, and the fingerprint of its certificate.

    Raises:
        RobotError: If the files are missing, do not fit each other, or others may read the key.
    """
    _refuse_others(private_key)
    fingerprint = _fingerprint(certificate)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    try:
        context.load_cert_chain(certificate, private_key)
    except (OSError, ssl.SSLError) as error:
        raise RobotError(f"{certificate} and {private_key} are no pair: {error}.") from error
    return context, fingerprint


def check_exposure(plan: DaemonPlan) -> None:
    """Refuse to let others drive.

    Raises:
        RobotError: If the plan listens beyond this machine without TLS and a key, and nobody asked
            for that.
    """
    secured = plan.certificate and plan.private_key and plan.key_file
    if not (secured or plan.insecure or is_loopback(plan.host)):
        raise RobotError(
            f"{plan.host} can be reached by others, and without a certificate and a key everybody "
            "there could drive the robot. Run `shapechanger robot init`, or listen at 127.0.0.1; "
            "`--insecure` does it all the same."
        )


def _fingerprint(certificate: Path) -> bytes:
    try:
        return fingerprint_of(ssl.PEM_cert_to_DER_cert(certificate.read_text().strip()))
    except FileNotFoundError as error:
        raise _missing(certificate) from error
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise RobotError(f"The certificate {certificate} cannot be read: {error}.") from error


def _refuse_others(file: Path) -> None:
    try:
        mode = file.stat().st_mode
    except FileNotFoundError as error:
        raise _missing(file) from error
    except OSError as error:
        raise RobotError(f"{file} cannot be read: {error}.") from error
    if mode & _OTHERS:
        raise RobotError(f"Others may read {file}. Run `chmod 600 {file}`; better, make it anew.")


def _missing(file: Path) -> RobotError:
    return RobotError(f"There is no {file}. Run `shapechanger robot init` to make it.")


def _self_signed(name: str) -> tuple[bytes, bytes]:
    """A certificate and its private key, both PEM."""
    # Loaded here, because only the making needs it: 10 MB that a daemon shall not hold.
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    private_key = ec.generate_private_key(ec.SECP256R1())
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    # A Pi without a battery may think that it is the past; its certificate began long before.
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
