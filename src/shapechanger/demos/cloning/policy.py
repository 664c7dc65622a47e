"""A policy that acts on an image, a state or both, and the file that it is stored in.

The file holds the weights as safetensors, with a card in JSON that describes the policy.
"""

from __future__ import annotations

import copy
from collections.abc import Generator, Mapping
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import STEERING, ActingClone, CloneCard
from shapechanger.demos.cloning.pictures import PolicyError
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra
from shapechanger.files import make_folder, write_atomic
from shapechanger.identity import Identity
from shapechanger.layout import Layout
from shapechanger.onnx_file import export_network
from shapechanger.policy import CLONE_CARD, read_tensors, refusing, tensor_bytes

try:
    import torch
    from torch import Tensor, nn

    from shapechanger.demos.cloning.examples import scaled
    from shapechanger.demos.cloning.network import CameraNetwork
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

KIND: Final = "clone"
"""Kind of the file of a cloned policy, see `shapechanger.policy`."""
_CHUNK: Final = 256  # Examples at a time, to bound the memory.


class CameraPolicy(ActingClone):
    """A policy for images, states or both.

    Attributes:
        network: The network.
        card: Architecture and origin.
    """

    def __init__(self, network: CameraNetwork, card: CloneCard) -> None:
        self.network = network.eval()
        self.card = card

    @classmethod
    def fresh(
        cls, settings: CloneSettings, seed: int, actions: Layout | None = None
    ) -> CameraPolicy:
        """Return an untrained policy whose actions are in [-1, 1], from an image.

        Args:
            settings: Architecture of the network.
            seed: Seed of the weights.
            actions: Meaning of the actions; None for the steering and throttle of any vehicle.
        """
        if actions is not None and actions.names == STEERING:
            actions = None
        card = CloneCard(
            framing=settings.framing,
            channels=settings.channels,
            features=settings.features,
            eyes=settings.eyes,
            action_layout=actions,
        )
        return cls.blank(card, seed)

    @classmethod
    def blank(cls, card: CloneCard, seed: int) -> CameraPolicy:
        """Return an untrained policy as a card describes it.

        Args:
            card: Architecture of the network.
            seed: Seed of the weights.
        """
        with seeded(seed):
            return cls(CameraNetwork(card), card)

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `ActingClone` describes them."""
        return _activated(self.logits(pictures, states), self.card).numpy()

    def logits(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> Tensor:
        """Return the outputs of the last layer, from which `outputs` are computed."""
        small, states = self.card.prepared(pictures, states)
        known = None if states is None else torch.as_tensor(states)
        n = len(small) if small is not None else len(known) if known is not None else 0
        found = torch.empty(n, self.network.hands.in_features)
        with torch.inference_mode():
            for start in range(0, n, _CHUNK):
                some = slice(start, start + _CHUNK)
                part = None if small is None else torch.as_tensor(small[some].copy())
                found[some] = self.network.perceive(
                    None if part is None else scaled(part),
                    None if known is None else known[some],
                )
            return self.network.hands(found)

    def described(
        self, *, command: str = "", identity: Mapping[str, Identity] | None = None, **data: Any
    ) -> CameraPolicy:
        """Return the same policy with more information on its card.

        Args:
            command: Command that trained it; "" keeps the present one.
            identity: Version of its env; None keeps the present one.
            **data: Origin of the demonstrations; values that JSON can hold.
        """
        card = msgspec.structs.replace(
            self.card,
            command=command or self.card.command,
            data={**self.card.data, **data},
            identity=self.card.identity if identity is None else dict(identity),
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
        weights = {name: value.numpy() for name, value in self.network.state_dict().items()}
        make_folder(path.parent)
        write_atomic(path, tensor_bytes(weights, msgspec.json.encode(self.card), KIND))

    @classmethod
    def load(cls, path: Path) -> CameraPolicy:
        """Read a policy; no code in the file is run.

        Raises:
            PolicyError: If the file is missing or damaged, or contains anything but a policy.
        """
        with refusing(path, PolicyError):
            content, weights = read_tensors(path, KIND)
            card = msgspec.json.decode(content, type=CloneCard)
            return cls(_network(card, weights), card)

    def export(self, path: Path, *, body: str = "", control_hz: float | None = None) -> None:
        """Write the policy as ONNX, which a robot runs without PyTorch.

        Its inputs are `picture`, uint8 of the shape (n, height, width, 3) that the card's framing
        gives, and `state`, float32 of shape (n, values); its output is `output`, float32: actions
        in [-1, 1], or probabilities of the card's classes.

        Args:
            path: The file, such as `car.onnx`.
            body: Kind of robot that it learned in; "" for any.
            control_hz: Actions per second that it learned with; None if unknown.

        Raises:
            MissingExtra: If onnx or onnxscript is not installed.
            OutputError: If the file cannot be written.
        """
        card = msgspec.structs.replace(self.card, body=body, control_hz=control_hz)
        kinds = {"picture": torch.uint8, "state": torch.float32}
        inputs = {
            name: torch.zeros((2, *shape), dtype=kinds[name]) for name, shape in card.inputs.items()
        }
        facts = {CLONE_CARD: msgspec.json.encode(card).decode()}
        export_network(_Whole(self.network, card), inputs, "output", path, facts)


@contextmanager
def seeded(seed: int) -> Generator[None]:
    """Seed the global generator, and restore it at the end."""
    fork = cast(
        "AbstractContextManager[None]",
        torch.random.fork_rng(devices=[]),  # pyright: ignore[reportUnknownMemberType]
    )
    with fork:
        torch.manual_seed(seed)  # pyright: ignore[reportUnknownMemberType]
        yield


class _Whole(nn.Module):
    """A network with the scaling of images and outputs."""

    def __init__(self, network: CameraNetwork, card: CloneCard) -> None:
        super().__init__()
        self.network, self.card = network, card

    def forward(self, *given: Tensor) -> Tensor:
        named = dict(zip(self.card.inputs, given, strict=True))
        seen = scaled(named["picture"]) if "picture" in named else None
        out = self.network.hands(self.network.perceive(seen, named.get("state")))
        return _activated(out, self.card)


def _activated(out: Tensor, card: CloneCard) -> Tensor:
    """Return probabilities of classes, or actions in [-1, 1], for outputs of the last layer."""
    return torch.softmax(out, dim=1) if card.classes else torch.tanh(out)


def _network(card: CloneCard, weights: Mapping[str, NDArray[Any]]) -> CameraNetwork:
    """Build the network that a card describes, with these weights."""
    # On the meta device a forged card cannot allocate memory before the sizes are compared.
    with torch.device("meta"):
        network = CameraNetwork(card)
    state = {name: torch.from_numpy(value.copy()) for name, value in weights.items()}  # pyright: ignore[reportUnknownMemberType]
    network.load_state_dict(state, assign=True)
    # Assigned weights lie in memory as in the file; sums in another order are other sums.
    network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
    for name, value in weights.items():
        if value.dtype != np.float32 or not np.isfinite(value).all():
            raise ValueError(f"its weights {name} must be finite and in single precision")
    return network
