"""A policy that drives by what it sees, feels or both, and the file that it is kept in.

The file is a zip of two entries: a card in JSON, which says where the policy comes from, and the
weights. Nothing in it is run: the weights are read as numbers only.
"""

from __future__ import annotations

import copy
import io
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import FORMATS, CloneCard
from shapechanger.demos.cloning.pictures import CloningError, PolicyError, prepare
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra, OutputError

try:
    import torch
    from torch import Tensor

    from shapechanger.demos.cloning.batches import plain
    from shapechanger.demos.cloning.network import CameraNetwork
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

__all__ = ["WEIGHTS", "CameraPolicy", "CloneCard"]

_CARD: Final = "card.json"
WEIGHTS: Final = "weights.pt"
"""The entry of a policy's file that no other policy's has."""

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


class CameraPolicy:
    """What to do on seeing a picture, on feeling a state, or both.

    Attributes:
        network: What computes it.
        card: Where it comes from.
    """

    def __init__(self, network: CameraNetwork, card: CloneCard) -> None:
        self.network = network.eval()
        self.card = card

    @classmethod
    def fresh(cls, settings: CloneSettings, seed: int) -> CameraPolicy:
        """A policy for steering and throttle from a picture that has learned nothing."""
        return cls.blank(
            CloneCard(
                framing=settings.framing,
                channels=settings.channels,
                features=settings.features,
                eyes=settings.eyes,
                format=1 if settings.eyes == "colours" else 2,
            ),
            seed,
        )

    @classmethod
    def blank(cls, card: CloneCard, seed: int) -> CameraPolicy:
        """The policy that a card describes, before it has learned anything."""
        with torch.random.fork_rng(devices=[]):  # pyright: ignore[reportUnknownMemberType]
            torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
            return cls(CameraNetwork(card), card)

    @property
    def n_features(self) -> int:
        """How many features it decides by."""
        return self.network.hands.in_features

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """What to do on seeing a picture and feeling a state.

        Args:
            picture: Red, green and blue, shape (H, W, 3), as recorded or prepared; None for a
                policy without eyes.
            state: Shape (k,), NaN for what is not known; None for a policy without a state.

        Returns:
            An action in the order of its layout. For a vehicle: steering (-1 is left) and throttle
            (1 is forward), each in [-1, 1], shape (2,).

        Raises:
            CloningError: If it is nothing that the policy can see or feel.
        """
        return self.predict_many(
            None if picture is None else picture[np.newaxis],
            None if state is None else state[np.newaxis],
        )[0]

    def predict_many(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """What to do each time.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), as recorded or prepared; None for a
                policy without eyes.
            states: Shape (n, k); None for a policy without a state.

        Returns:
            Actions, shape (n, m).

        Raises:
            CloningError: If it is nothing that the policy can see or feel.
        """
        out = self.outputs(pictures, states)
        if self.card.classes:
            return np.asarray(self.card.classes, np.float32)[out.argmax(axis=1)]
        if not self.card.low:
            return out
        low, high = (np.asarray(x, np.float32) for x in (self.card.low, self.card.high))
        return (low + 0.5 * (out + 1.0) * (high - low)).astype(np.float32)

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """What the network says: probabilities of the classes, or actions scaled to [-1, 1].

        Args:
            pictures: As in `predict_many`.
            states: As in `predict_many`.

        Returns:
            Shape (n, classes), each row of sum 1; or shape (n, m).
        """
        with torch.inference_mode():
            out = self.network.hands(self._perceived(pictures, states))
            return (torch.softmax(out, dim=1) if self.card.classes else torch.tanh(out)).numpy()

    def features(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """What it makes of what it sees and feels, before it decides.

        Args:
            pictures: As in `predict_many`.
            states: As in `predict_many`.

        Returns:
            Features, each at least 0, shape (n, n_features).

        Raises:
            CloningError: If it is nothing that the policy can see or feel.
        """
        with torch.inference_mode():
            return self._perceived(pictures, states).numpy()

    def _perceived(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None
    ) -> Tensor:
        small = self._seen(pictures)
        felt = self._felt(states)
        n = len(small) if small is not None else len(felt) if felt is not None else 0
        found = torch.empty(n, self.n_features)
        for start in range(0, n, _AT_A_TIME):
            some = slice(start, start + _AT_A_TIME)
            part = None if small is None else torch.as_tensor(small[some].copy())
            found[some] = self.network.perceive(
                None if part is None else plain(part, torch.arange(len(part))),
                None if felt is None else felt[some],
            )
        return found

    def _seen(self, pictures: NDArray[np.uint8] | None) -> NDArray[np.uint8] | None:
        if self.card.eyes == "none":
            return None
        if pictures is None:
            raise CloningError("This policy drives by pictures, and there is none.")
        return prepare(pictures, self.card.framing)

    def _felt(self, states: NDArray[np.floating] | None) -> Tensor | None:
        layout = self.card.state_layout
        if layout is None:
            return None
        if states is None or states.ndim != 2 or states.shape[1] != layout.size:
            raise CloningError(
                f"This policy feels {', '.join(layout.names)}: states of shape (n, {layout.size}), "
                f"got {'none' if states is None else states.shape}."
            )
        felt = np.array(states, np.float32)
        for name in self.card.unseen:
            felt[:, layout.slices[name]] = np.nan
        return torch.as_tensor(felt)

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
                card = msgspec.json.decode(_entry(archive, _CARD), type=CloneCard)
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


def _require_format(card: CloneCard) -> None:
    if card.format not in FORMATS:
        raise ValueError(
            f"it has format {card.format} of Shapechanger {card.version}; this one reads "
            f"{' and '.join(map(str, FORMATS))}."
        )


def _network(card: CloneCard, weights: bytes) -> CameraNetwork:
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
        network = CameraNetwork(card)
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
