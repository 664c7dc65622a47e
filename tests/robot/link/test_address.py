"""Parsing of addresses."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.robot.link.address import (
    Address,
    address_here,
    cannot_listen,
    is_loopback,
    parse_address,
)


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("car.local", Address("car.local", 5000)),
        (" car.local:8443 ", Address("car.local", 8443)),
        ("my_car", Address("my_car", 5000)),
        ("192.168.42.1", Address("192.168.42.1", 5000)),
        ("192.168.42.1:1", Address("192.168.42.1", 1)),
        ("::1", Address("::1", 5000)),
        ("[::1]", Address("::1", 5000)),
        ("[fe80::1%wlan0]:65535", Address("fe80::1%wlan0", 65535)),
    ],
)
def test_addresses_are_parsed(text: str, address: Address) -> None:
    assert parse_address(text) == address
    assert parse_address(str(address)) == address


@pytest.mark.parametrize(
    "text",
    [
        *("", "car local", "https://car.local", "user@car", "-car", "x" * 64, "a." * 127),
        *("300.1.1.1", "1.2.3", "[::1", "[car]:5000", "[::1]5000", "::1]", "[]:80"),
        *("[fe80::1%a/b]", "[fe80::1%a@b]", "fe80::1%a/b", "fe80::1%a@b"),
        *("car:", "car:0", "car:65536", "car:000080", "car:٣", "car:12:13", "[::1]:"),
    ],
)
def test_an_invalid_address_is_an_error_with_examples(text: str) -> None:
    with pytest.raises(LinkError, match=r"not a valid address.*192\.168\.42\.1:5000") as refused:
        parse_address(text)
    assert repr(text) in str(refused.value)


@given(text=st.text(max_size=30))
def test_any_text_is_an_address_or_an_error(text: str) -> None:
    try:
        address = parse_address(text)
    except LinkError:
        return
    assert parse_address(str(address)) == address


def test_loopback_addresses() -> None:
    """A server that listens at all addresses is reached at the loopback address."""
    assert all(map(is_loopback, ("127.0.0.1", "127.9.9.9", "::1", "localhost")))
    assert not any(map(is_loopback, ("0.0.0.0", "::", "192.168.42.1", "car.local", "")))
    for host in ("", "0.0.0.0", "::"):
        assert address_here(host, 7) == Address("127.0.0.1", 7)
    assert address_here("car.local", 8) == Address("car.local", 8)


def test_the_error_about_a_port_gives_the_cause() -> None:
    for error, why in (
        (OSError(98, "bind on address"), "Address already in use"),
        (OSError(-2, "Name or service not known"), "[Errno -2] Name or service not known"),
        (OSError("no number"), "no number"),
    ):
        assert str(cannot_listen("car.local", 5000, error)) == (
            f"Cannot listen at car.local port 5000: {why}. Is the robot served already?"
        )
