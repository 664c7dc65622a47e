"""A policy that acts on an image, a state or both, and the file that it is stored in.

The file holds the weights as safetensors, with a card in JSON that describes the policy.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import ActingClone, CloneCard
from shapechanger.demos.cloning.pictures import CloningError, PolicyError
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import MissingExtra, no_policy_file
from shapechanger.files import cannot_write, write_atomic
from shapechanger.identity import Identity
from shapechanger.policy import UNUSABLE, read_tensors, tensor_bytes

try:
    import torch
    from torch import Tensor

    from shapechanger.demos.cloning.examples import plain
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
    def fresh(cls, settings: CloneSettings, seed: int) -> CameraPolicy:
        """Return an untrained policy for steering and throttle from an image.

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

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `ActingClone` describes them."""
        out = self.logits(pictures, states)
        return (torch.softmax(out, dim=1) if self.card.classes else torch.tanh(out)).numpy()

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
                    None if part is None else plain(part, torch.arange(len(part))),
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
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise cannot_write(path, error) from error
        write_atomic(path, tensor_bytes(weights, msgspec.json.encode(self.card), KIND))

    @classmethod
    def load(cls, path: Path) -> CameraPolicy:
        """Read a policy; no code in the file is run.

        Raises:
            PolicyError: If the file is missing or damaged, or contains anything but a policy.
        """
        try:
            content, weights = read_tensors(path, KIND)
            card = msgspec.json.decode(content, type=CloneCard)
            return cls(_network(card, weights), card)
        except FileNotFoundError as error:
            raise PolicyError(no_policy_file(path)) from error
        except (*UNUSABLE, CloningError) as error:
            # Messages of PyTorch fill a page; the first line is enough.
            reason = str(error).strip().partition("\n")[0].rstrip(".:") or type(error).__name__
            raise PolicyError(f"{path} is not a cloned policy: {reason}.") from error


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
