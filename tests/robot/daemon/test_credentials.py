"""Key and certificate of a robot."""

import shutil
import ssl
import subprocess
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509

from shapechanger.errors import RobotError
from shapechanger.robot.daemon.credentials import (
    check_exposure,
    credentials_folder,
    load_credentials,
    make_credentials,
    read_key,
    server_tls,
)
from shapechanger.robot.link.authentication import fingerprint_of
from shapechanger.robot.serve import recordings_folder
from tests.robot.daemon.plans import car_plan


def test_credentials_are_made_once_and_are_the_owners(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "car"
    made = make_credentials(folder, "my car")
    assert make_credentials(folder, "my car") == made == load_credentials(folder)
    key = read_key(made.key_file)
    assert len(key) == 16
    modes = [path.stat().st_mode & 0o777 for path in (folder, made.key_file, made.private_key)]
    assert modes == [0o700, 0o600, 0o600]
    certificate = x509.load_pem_x509_certificate(made.certificate.read_bytes())
    assert certificate.subject.rfc4514_string() == "CN=my car"
    assert certificate.not_valid_before_utc < datetime(2020, 1, 2, tzinfo=UTC)
    assert certificate.not_valid_after_utc > datetime.now(UTC) + timedelta(days=3_600)
    der = ssl.PEM_cert_to_DER_cert(made.certificate.read_text())
    assert made.fingerprint == fingerprint_of(der)
    shutil.rmtree(folder)
    new = make_credentials(folder, "my car")
    assert read_key(new.key_file) != key
    assert new.fingerprint != made.fingerprint


def test_tls_1_3_is_required(tmp_path: Path) -> None:
    made = make_credentials(tmp_path, "car")
    context, fingerprint = server_tls(made.certificate, made.private_key)
    assert context.minimum_version is ssl.TLSVersion.TLSv1_3
    assert fingerprint == made.fingerprint


@pytest.mark.parametrize("name", ["key", "certificate.key"])
def test_a_key_that_others_may_read_is_refused(tmp_path: Path, name: str) -> None:
    make_credentials(tmp_path, "car")
    (tmp_path / name).chmod(0o640)
    with pytest.raises(RobotError, match="chmod 600"):
        load_credentials(tmp_path)


@pytest.mark.parametrize("name", ["key", "certificate.pem", "certificate.key"])
def test_incomplete_credentials_are_not_completed(tmp_path: Path, name: str) -> None:
    make_credentials(tmp_path, "car")
    (tmp_path / name).unlink()
    with pytest.raises(RobotError, match="only some"):
        make_credentials(tmp_path, "car")
    with pytest.raises(RobotError, match="robot init"):
        load_credentials(tmp_path)


@pytest.mark.parametrize(
    ("name", "garbage"),
    [
        ("key", b"short"),
        ("key", b"\xff\xfe"),
        ("certificate.pem", b"x"),
        ("certificate.pem", b"\xff"),
    ],
)
def test_malformed_credentials_are_refused(tmp_path: Path, name: str, garbage: bytes) -> None:
    make_credentials(tmp_path, "car")
    (tmp_path / name).write_bytes(garbage)
    with pytest.raises(RobotError, match=name):
        load_credentials(tmp_path)


def test_a_certificate_of_another_key_is_refused(tmp_path: Path) -> None:
    one, two = (make_credentials(tmp_path / name, name) for name in ("one", "two"))
    with pytest.raises(RobotError, match="do not match"):
        server_tls(one.certificate, two.private_key)


@pytest.mark.parametrize(
    ("variable", "folder_of", "default"),
    [
        ("XDG_CONFIG_HOME", credentials_folder, ".config/shapechanger/robots/car"),
        ("XDG_DATA_HOME", recordings_folder, ".local/share/shapechanger/recordings/car"),
    ],
)
def test_folders_follow_the_xdg_specification(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    variable: str,
    folder_of: Callable[[str], Path],
    default: str,
) -> None:
    monkeypatch.delenv(variable, raising=False)
    assert folder_of("car") == Path.home() / default
    monkeypatch.setenv(variable, "relative")
    assert folder_of("car") == Path.home() / default
    monkeypatch.setenv(variable, str(tmp_path))
    assert folder_of("car") == tmp_path / default[default.index("shapechanger") :]


@pytest.mark.parametrize("name", ["", "..", ".hidden", "a/b", "a\0b"])
def test_a_name_cannot_leave_the_folder(name: str) -> None:
    for folder_of in (credentials_folder, recordings_folder):
        with pytest.raises(RobotError, match="valid folder name"):
            folder_of(name)


def test_serving_other_machines_needs_a_key() -> None:
    check_exposure(car_plan(host="127.0.0.1"))
    check_exposure(car_plan(host="0.0.0.0", insecure=True))
    secured = {"certificate": "c", "private_key": "p", "key_file": "k"}
    check_exposure(car_plan(host="0.0.0.0", **secured))
    for missing in secured:
        with pytest.raises(RobotError, match="--insecure"):
            check_exposure(car_plan(host="0.0.0.0", **(secured | {missing: ""})))


def test_reading_credentials_does_not_import_the_certificate_builder() -> None:
    script = (
        "import sys, shapechanger.robot.daemon.process; "
        "assert 'cryptography' not in sys.modules and 'gpiozero' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
