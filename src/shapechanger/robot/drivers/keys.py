"""Keys of a table in a profile: their types, and the pins and addresses that they claim."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Final, NamedTuple, cast

import msgspec
from msgspec import Meta

from shapechanger.robot.drivers.pins import I2C_PINS, Pin

_PRINTABLE: Final = r"\A(?=.*\S)[\x20-\x7e\xa0-\U0010ffff]+\Z"

_TEXT: Final = "a text of 1 to {} characters that can be printed"

Text = Annotated[
    str,
    Meta(min_length=1, max_length=64, pattern=_PRINTABLE, description=_TEXT.format(64)),
]
"""A name, as long as names in messages may be; see `shapechanger.robot.link.messages`."""

FilePath = Annotated[
    str,
    Meta(min_length=1, max_length=4096, pattern=_PRINTABLE, description=_TEXT.format(4096)),
]
"""Path of a file or a device."""

BusNumber = Annotated[int, Meta(ge=0, le=99)]
"""Number of an I2C bus; 1 is GPIO2 and GPIO3."""


class KeyMistake(ValueError):
    """A value of a key that the other keys of its table do not allow.

    Args:
        key: Name of the key.
        words: What is wrong, as the end of a sentence that begins with the key and its table.
    """

    def __init__(self, key: str, words: str) -> None:
        super().__init__(words)
        self.key = key


class Claim(NamedTuple):
    """Something that only one key of a profile may use: a pin, a channel or an address.

    Attributes:
        key: Name of the key that claims it.
        what: The pin, channel or address.
        group: Users of one group may share it; "" for exclusive use.
        use: What it is used for, as the end of a sentence; may be empty.
    """

    key: str
    what: str
    group: str = ""
    use: str = ""


class Keys(msgspec.Struct, frozen=True):
    """Keys of one table; a subclass raises `KeyMistake` for values that contradict each other."""

    def settings(self) -> dict[str, Any]:
        """Return the settings of the driver, as JSON can hold them."""
        return msgspec.structs.asdict(self)

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the keys: by default their pins."""
        for key, value in msgspec.structs.asdict(self).items():
            for pin in cast("list[Any]", value) if isinstance(value, list) else [value]:
                if isinstance(pin, Pin) and pin >= 0:
                    yield Claim(key, f"GPIO{pin}")


def i2c_claims(bus: int, key: str, address: int, group: str = "") -> Iterator[Claim]:
    """Return the claims of a chip on an I2C bus.

    Args:
        bus: Number of the bus.
        key: Key of the address.
        address: The address.
        group: What the chip shares its address with; "" for nothing.
    """
    yield Claim(key, f"address {address:#x} of I2C bus {bus}", group)
    for pin in I2C_PINS.get(bus, ()):
        yield Claim("bus", f"GPIO{pin}", f"I2C bus {bus}", f", a wire of I2C bus {bus},")


class I2cKeys(Keys, frozen=True, kw_only=True):
    """Keys of a chip on an I2C bus.

    Attributes:
        bus: Number of the bus; 1 is GPIO2 and GPIO3.
        address: Address of the chip.
    """

    bus: BusNumber = 1
    address: int

    def claims(self) -> Iterator[Claim]:
        """Return the claims of the bus and the address."""
        return i2c_claims(self.bus, "address", self.address)
