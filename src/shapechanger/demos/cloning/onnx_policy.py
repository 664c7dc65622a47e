"""Cloned policies as ONNX files, which a robot runs without PyTorch.

The file holds the network from a prepared image, a state or both to its outputs. Its metadata has
the card of the policy and what else a robot compares before it arms. Reading one runs no code.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import ActingClone, CloneCard
from shapechanger.demos.cloning.pictures import PolicyError
from shapechanger.onnx_file import OnnxNetwork, export_network

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy

_CARD: Final = "shapechanger-clone"
_PICTURE: Final = "picture"
_STATE: Final = "state"
_OUTPUT: Final = "output"


def export_clone(
    policy: CameraPolicy, path: Path, *, body: str = "", control_hz: float | None = None
) -> None:
    """Write a cloned policy as ONNX.

    Its inputs are `picture`, uint8 of the shape (n, height, width, 3) that the card's framing
    gives, and `state`, float32 of shape (n, values); its output is `output`, float32: actions in
    [-1, 1], or probabilities of the card's classes.

    Args:
        policy: The policy.
        path: The file, such as `car.onnx`.
        body: Kind of robot that it learned in; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.

    Raises:
        MissingExtra: If onnx or onnxscript is not installed.
        OutputError: If the file cannot be written.
    """
    import torch

    from shapechanger.demos.cloning.examples import scaled  # PyTorch.

    card = policy.card
    inputs: dict[str, Any] = {}
    if card.eyes != "none":
        inputs[_PICTURE] = torch.zeros((2, *card.framing.shape), dtype=torch.uint8)
    if card.state_size:
        inputs[_STATE] = torch.zeros((2, card.state_size))

    class Whole(torch.nn.Module):
        """The network with the scaling of images and outputs."""

        def __init__(self) -> None:
            super().__init__()
            self.network = policy.network

        def forward(self, *given: torch.Tensor) -> torch.Tensor:
            named = dict(zip(inputs, given, strict=True))
            picture = named.get(_PICTURE)
            seen = None if picture is None else scaled(picture)
            out = self.network.hands(self.network.perceive(seen, named.get(_STATE)))
            return torch.softmax(out, dim=1) if card.classes else torch.tanh(out)

    card = msgspec.structs.replace(card, body=body, control_hz=control_hz)
    facts = {_CARD: msgspec.json.encode(card).decode()}
    export_network(Whole(), inputs, _OUTPUT, path, facts)


class OnnxClone(ActingClone):
    """A cloned policy from a file of `export_clone`.

    Attributes:
        card: Card of the policy.
        body: Kind of robot that it learned in; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.
        digest: First digits of the SHA-256 of the file.

    Args:
        path: The file, read once: a later change of it changes nothing here.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        PolicyError: If the file is missing or is not such a policy.
    """

    def __init__(self, path: Path) -> None:
        self._network = OnnxNetwork(path, CloneCard, _shapes, PolicyError, _CARD)
        self.card = self._network.card
        self.body, self.control_hz = self.card.body, self.card.control_hz
        self.digest = self._network.digest

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `ActingClone` describes them."""
        seen, known = self.card.prepared(pictures, states)
        given = {_PICTURE: seen, _STATE: known}
        return self._network.run({name: part for name, part in given.items() if part is not None})


def _shapes(card: CloneCard) -> dict[str, list[int]]:
    """Return the shapes of inputs and output that a card states."""
    shapes: dict[str, list[int]] = {}
    if card.eyes != "none":
        shapes[_PICTURE] = list(card.framing.shape)
    if card.state_size:
        shapes[_STATE] = [card.state_size]
    return shapes | {_OUTPUT: [card.outputs]}
