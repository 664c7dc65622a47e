"""A policy that acts on a picture, a state or both, and the file that it is stored in.

The file is a zip with two entries: a card in JSON, which describes the policy, and the weights.
Loading runs no code from the file, whatever its origin: it refuses weights whose pickle contains
anything but tensors.
"""

from __future__ import annotations

import copy
import io
import os
import pickle
import pickletools
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
"""Entry that identifies the file of a cloned policy."""

_MAX_ENTRY_BYTES: Final = 64 * 2**20  # A network of the default settings has half a megabyte.
# The earliest date that a zip can hold, so that equal policies give equal files.
_NO_DATE: Final = (1980, 1, 1, 0, 0, 0)
# All that a pickle of single-precision tensors refers to.
_TENSOR_GLOBALS: Final = frozenset(
    {"collections OrderedDict", "torch._utils _rebuild_tensor_v2", "torch FloatStorage"}
)
# Other opcodes that import or construct objects.
_OBJECT_OPCODES: Final = frozenset(
    {"STACK_GLOBAL", "INST", "OBJ", "NEWOBJ", "NEWOBJ_EX", "EXT1", "EXT2", "EXT4"}
)
# Raised by PyTorch, pickle and zipfile for damaged or malicious files.
_DAMAGED: Final = (
    RuntimeError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    ArithmeticError,
    EOFError,
    pickle.UnpicklingError,
)
_CHUNK: Final = 256  # Examples at a time, to bound the memory.


class CameraPolicy:
    """A policy for pictures, states or both.

    Attributes:
        network: The network.
        card: Architecture and origin.
    """

    def __init__(self, network: CameraNetwork, card: CloneCard) -> None:
        self.network = network.eval()
        self.card = card

    @classmethod
    def fresh(cls, settings: CloneSettings, seed: int) -> CameraPolicy:
        """Return an untrained policy for steering and throttle from a picture.

        Args:
            settings: Architecture of the network.
            seed: Seed of the weights.
        """
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
        """Return an untrained policy as a card describes it.

        Args:
            card: Architecture of the network.
            seed: Seed of the weights.
        """
        with torch.random.fork_rng(devices=[]):  # pyright: ignore[reportUnknownMemberType]
            torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
            return cls(CameraNetwork(card), card)

    @property
    def n_features(self) -> int:
        """Number of features in front of the last layer."""
        return self.network.hands.in_features

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the action for one picture and state, as `predict_many` does for several.

        Args:
            picture: Red, green and blue, shape (H, W, 3).
            state: Shape (k,).

        Returns:
            Action, shape (m,). For a vehicle: steering (-1 is left) and throttle (1 is forward).
        """
        return self.predict_many(
            None if picture is None else picture[np.newaxis],
            None if state is None else state[np.newaxis],
        )[0]

    def predict_many(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return an action for each picture and state.

        Args:
            pictures: Red, green and blue, shape (n, H, W, 3), raw or prepared; None for a policy
                without pictures.
            states: Shape (n, k), NaN for unknown values; None for a policy without a state.

        Returns:
            Actions, shape (n, m).

        Raises:
            CloningError: If an input is missing or has another shape.
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
        """Return class probabilities, shape (n, classes); or actions in [-1, 1], shape (n, m).

        Arguments and errors are those of `predict_many`.
        """
        out = self.logits(pictures, states)
        return (torch.softmax(out, dim=1) if self.card.classes else torch.tanh(out)).numpy()

    def logits(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> Tensor:
        """Return the outputs of the last layer, from which `outputs` are computed."""
        with torch.inference_mode():
            return self.network.hands(torch.as_tensor(self.features(pictures, states)))

    def features(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the features in front of the last layer, each at least 0, shape (n, n_features).

        Arguments and errors are those of `predict_many`.
        """
        small = self._seen(pictures)
        felt = self._felt(states)
        n = len(small) if small is not None else len(felt) if felt is not None else 0
        found = torch.empty(n, self.n_features)
        with torch.inference_mode():
            for start in range(0, n, _CHUNK):
                some = slice(start, start + _CHUNK)
                part = None if small is None else torch.as_tensor(small[some].copy())
                found[some] = self.network.perceive(
                    None if part is None else plain(part, torch.arange(len(part))),
                    None if felt is None else felt[some],
                )
        return found.numpy()

    def _seen(self, pictures: NDArray[np.uint8] | None) -> NDArray[np.uint8] | None:
        if self.card.eyes == "none":
            return None
        if pictures is None:
            raise CloningError("This policy needs a picture, but there is none.")
        return prepare(pictures, self.card.framing)

    def _felt(self, states: NDArray[np.floating] | None) -> Tensor | None:
        layout = self.card.state_layout
        if layout is None:
            return None
        if states is None or states.ndim != 2 or states.shape[1] != layout.size:
            raise CloningError(
                f"This policy needs the state {', '.join(layout.names)} with shape "
                f"(n, {layout.size}), got {'none' if states is None else states.shape}."
            )
        felt = np.array(states, np.float32)
        for name in self.card.unseen:
            felt[:, layout.slices[name]] = np.nan
        return torch.as_tensor(felt)

    def described(self, *, command: str = "", **data: Any) -> CameraPolicy:
        """Return the same policy with more information on its card.

        Args:
            command: Command that trained it; "" keeps the present one.
            **data: Origin of the demonstrations; values that JSON can hold.
        """
        card = msgspec.structs.replace(
            self.card, command=command or self.card.command, data={**self.card.data, **data}
        )
        return CameraPolicy(self.network, card)

    def copy(self) -> CameraPolicy:
        """Return a policy that shares no weights with this one."""
        return CameraPolicy(copy.deepcopy(self.network), self.card)

    def save(self, path: Path) -> None:
        """Write the policy to a file, atomically.

        Raises:
            OutputError: If the file cannot be written.
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
        """Read a policy; no code in the file is run.

        Raises:
            PolicyError: If the file is missing or damaged, or contains anything but a policy.
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
            raise PolicyError(f"{path} is not a cloned policy: {error}") from error
        except _DAMAGED as error:
            # Messages of PyTorch fill a page; the first line is enough.
            reason = str(error).strip().partition("\n")[0]
            raise PolicyError(f"{path} is not an intact policy: {reason}") from error


def _entry(archive: zipfile.ZipFile, name: str) -> bytes:
    """Read an entry of the file, unless it is larger than any policy."""
    if archive.getinfo(name).file_size > _MAX_ENTRY_BYTES:
        raise ValueError(f"its {name} is larger than {_MAX_ENTRY_BYTES} bytes.")
    return archive.read(name)


def _require_format(card: CloneCard) -> None:
    if card.format not in FORMATS:
        raise ValueError(
            f"it has format {card.format} of Shapechanger {card.version}; this version reads "
            f"{' and '.join(map(str, FORMATS))}."
        )


def _require_tensors(archive: zipfile.ZipFile) -> None:
    """Refuse weights whose pickle contains anything but tensors, without unpickling it."""
    for name in archive.namelist():
        if not name.endswith(".pkl"):
            continue
        for opcode, argument, _ in pickletools.genops(_entry(archive, name)):
            foreign = opcode.name == "GLOBAL" and argument not in _TENSOR_GLOBALS
            if foreign or opcode.name in _OBJECT_OPCODES:
                what = str(argument).replace(" ", ".") if foreign else opcode.name
                raise ValueError(f"its weights contain {what}, but only tensors are allowed.")


def _network(card: CloneCard, weights: bytes) -> CameraNetwork:
    """Build the network that a card describes, with these weights."""
    if not zipfile.is_zipfile(io.BytesIO(weights)):  # PyTorch would try older formats.
        raise ValueError("its weights are truncated, or have another format.")
    with zipfile.ZipFile(io.BytesIO(weights)) as archive:
        _require_tensors(archive)
    loaded = torch.load(  # pyright: ignore[reportUnknownMemberType]
        io.BytesIO(weights), map_location="cpu", weights_only=True
    )
    if not isinstance(loaded, dict):
        raise ValueError("its weights are not a dictionary.")
    state = cast("dict[str, Tensor]", loaded)
    # On the meta device a forged card cannot allocate memory before the sizes are compared.
    with torch.device("meta"):
        network = CameraNetwork(card)
    network.load_state_dict(state, assign=True)
    for name, value in state.items():
        if value.dtype != torch.float32 or not bool(torch.isfinite(value).all()):
            raise ValueError(f"its weights {name} must be finite and in single precision.")
    return network


def _write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically."""
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
