"""A policy that drives by what a camera sees, and the file that it is kept in.

The file is a zip of two entries: a card in JSON, which says where the policy comes from, and the
weights. Nothing in it is run: the weights are read as numbers only.
"""

from __future__ import annotations

import copy
import io
import os
import pickle
import zipfile
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.errors import CloningError, PolicyError
from shapechanger.demos.cloning.pictures import Framing, prepare
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra, OutputError

try:
    import torch
    from torch import Tensor

    from shapechanger.demos.cloning.augment import plain
    from shapechanger.demos.cloning.network import CameraNetwork
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

__all__ = ["WEIGHTS", "CameraPolicy", "Card"]

_CARD: Final = "card.json"
WEIGHTS: Final = "weights.pt"
"""The entry of a policy's file that no other policy's has."""

_FORMAT: Final = 1
# A network of the default settings is half a megabyte; more than this is something else.
_LARGEST_ENTRY: Final = 64 * 2**20
# So that the same policy is the same file. The earliest date that a zip can hold.
_NO_DATE: Final = (1980, 1, 1, 0, 0, 0)
# What Torch and the zip reader say of files that are damaged, or made to do harm.
_NOT_WHOLE: Final = (
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    ArithmeticError,
    EOFError,
    pickle.UnpicklingError,
)
# Pictures at a time where many are looked at.
_AT_A_TIME: Final = 256


class Card(msgspec.Struct, frozen=True, kw_only=True):
    """Where a policy comes from.

    Attributes:
        framing: What it sees.
        channels: Filters of each of its layers.
        features: Numbers between picture and actions.
        seeds: Seeds of the trainings that made it, the last one last.
        steps: Steps of the last training, up to the best policy.
        settings: Settings of the last training.
        data: What it was learned from, in the caller's words.
        command: The command that made it.
        version: Version of Shapechanger.
        format: Of the file.
    """

    framing: Framing
    channels: tuple[int, ...]
    features: int
    seeds: tuple[int, ...] = ()
    steps: int = 0
    settings: CloneSettings | None = None
    data: dict[str, Any] = {}
    command: str = ""
    version: str = msgspec.field(default_factory=lambda: version("shapechanger"))
    format: int = _FORMAT

    def __post_init__(self) -> None:
        """Refuse what describes no network.

        Raises:
            CloningError: If it has layers without filters, or no features.
        """
        if not self.channels or min(self.features, *self.channels) < 1:
            raise CloningError("A network has layers, and each has at least one number.")


class CameraPolicy:
    """Steering and throttle from a picture.

    Attributes:
        network: What computes them.
        card: Where it comes from.
    """

    def __init__(self, network: CameraNetwork, card: Card) -> None:
        self.network = network.eval()
        self.card = card

    @classmethod
    def fresh(cls, settings: CloneSettings, seed: int) -> CameraPolicy:
        """A policy that has learned nothing."""
        with torch.random.fork_rng(devices=[]):  # pyright: ignore[reportUnknownMemberType]
            torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
            network = CameraNetwork(settings.framing, settings.channels, settings.features)
        card = Card(
            framing=settings.framing, channels=settings.channels, features=settings.features
        )
        return cls(network, card)

    def predict(self, picture: NDArray[np.uint8]) -> NDArray[np.float32]:
        """What to do on seeing a picture.

        Args:
            picture: Red, green and blue, shape (H, W, 3), as recorded or prepared.

        Returns:
            Steering (-1 is left) and throttle (1 is forward), each in [-1, 1], shape (2,).

        Raises:
            CloningError: If it is no picture that the policy can see.
        """
        return self.predict_many(picture[np.newaxis])[0]

    def predict_many(self, pictures: NDArray[np.uint8]) -> NDArray[np.float32]:
        """What to do on seeing each of some pictures.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), as recorded or prepared.

        Returns:
            Steering and throttle, shape (n, 2).

        Raises:
            CloningError: If they are no pictures that the policy can see.
        """
        with torch.inference_mode():
            return torch.tanh(self.network.hands(self._seen(pictures))).numpy()

    def features(self, pictures: NDArray[np.uint8]) -> NDArray[np.float32]:
        """What the eyes make of each of some pictures.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), as recorded or prepared.

        Returns:
            Features, each at least 0, shape (n, features).

        Raises:
            CloningError: If they are no pictures that the policy can see.
        """
        with torch.inference_mode():
            return self._seen(pictures).numpy()

    def _seen(self, pictures: NDArray[np.uint8]) -> Tensor:
        small = prepare(pictures, self.card.framing)
        found = torch.empty(len(small), self.card.features)
        for start in range(0, len(small), _AT_A_TIME):
            part = torch.as_tensor(small[start : start + _AT_A_TIME].copy())
            found[start : start + len(part)] = self.network.eyes(
                plain(part, torch.arange(len(part)))
            )
        return found

    def described(self, *, command: str = "", **data: Any) -> CameraPolicy:
        """The same policy with more on its card.

        Args:
            command: The command that made it; none leaves the one that is there.
            **data: What it was learned from; values that JSON can hold.
        """
        card = msgspec.structs.replace(
            self.card, command=command or self.card.command, data={**self.card.data, **data}
        )
        return CameraPolicy(self.network, card)

    def copy(self) -> CameraPolicy:
        """A policy that shares no weights with this one."""
        return CameraPolicy(copy.deepcopy(self.network), self.card)

    def save(self, path: Path) -> None:
        """Write the policy to one file, which appears whole or not at all.

        Raises:
            OutputError: If it cannot be written.
        """
        weights = io.BytesIO()
        torch.save(self.network.state_dict(), weights)
        whole = io.BytesIO()
        with zipfile.ZipFile(whole, "w") as archive:
            card = msgspec.json.format(msgspec.json.encode(self.card), indent=1)
            archive.writestr(zipfile.ZipInfo(_CARD, _NO_DATE), card)
            archive.writestr(zipfile.ZipInfo(WEIGHTS, _NO_DATE), weights.getvalue())
        _write_whole(path, whole.getvalue())

    @classmethod
    def load(cls, path: Path) -> CameraPolicy:
        """Read what `save` wrote.

        Raises:
            PolicyError: If the file is missing, damaged or something else.
        """
        try:
            with zipfile.ZipFile(path) as archive:
                card = msgspec.json.decode(_entry(archive, _CARD), type=Card)
                weights = _entry(archive, WEIGHTS)
            _require_format(card)
            return cls(_network(card, weights), card)
        except FileNotFoundError as error:
            raise PolicyError(f"There is no policy file {path}.") from error
        except (OSError, zipfile.BadZipFile, msgspec.MsgspecError, CloningError) as error:
            raise PolicyError(f"{path} is not a policy that drives by pictures: {error}") from error
        except _NOT_WHOLE as error:
            # Torch's own messages fill a page; the first line says it.
            reason = str(error).strip().partition("\n")[0]
            raise PolicyError(f"{path} is no whole policy: {reason}") from error


def _entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """One entry of the file; what no policy could fill is not even unpacked."""
    if archive.getinfo(name).file_size > _LARGEST_ENTRY:
        raise ValueError(f"its {name} is larger than any policy's.")
    return archive.read(name)


def _require_format(card: Card) -> None:
    if card.format != _FORMAT:
        raise ValueError(
            f"it has format {card.format} of Shapechanger {card.version}; this one reads {_FORMAT}."
        )


def _network(card: Card, weights: bytes) -> CameraNetwork:
    """The network that a card describes, with these weights."""
    if not zipfile.is_zipfile(io.BytesIO(weights)):  # Torch would try older formats, and warn.
        raise ValueError("its weights are cut off or something else.")
    loaded = torch.load(  # pyright: ignore[reportUnknownMemberType]
        io.BytesIO(weights), map_location="cpu", weights_only=True
    )
    if not isinstance(loaded, dict):
        raise ValueError("its weights have no names.")
    state = cast("dict[str, Tensor]", loaded)
    # On the meta device a card that lies about its sizes takes no memory before it is found out.
    with torch.device("meta"):
        network = CameraNetwork(card.framing, card.channels, card.features)
    network.load_state_dict(state, assign=True)
    for name, value in state.items():
        if value.dtype != torch.float32 or not bool(torch.isfinite(value).all()):
            raise ValueError(f"its weights {name} are not all finite numbers in single precision.")
    return network


def _write_whole(path: Path, content: bytes) -> None:
    """Write a file that appears whole, or leaves what was there."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise OutputError(f"Cannot write {path}: {error.strerror or error}.") from error
