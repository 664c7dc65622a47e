"""Cloned policies as ONNX files, which a robot runs without PyTorch.

The file holds the network from a prepared picture, a state or both to its outputs. Its metadata has
the card of the policy and what else a robot compares before it arms. Reading one runs no code.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import PolicyError, prepare
from shapechanger.onnx_file import OnnxNetwork, export_network

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy

_CARD: Final = "shapechanger-clone"
_PICTURE: Final = "picture"
_STATE: Final = "state"
_OUTPUT: Final = "output"


class OnboardCard(msgspec.Struct, frozen=True, kw_only=True):
    """Card of an exported policy.

    Attributes:
        clone: Card of the policy.
        body: Kind of robot that it learned in, such as "car"; "" for any.
        control_hz: Actions per second that it learned with; None if unknown.
    """

    clone: CloneCard
    body: str = ""
    control_hz: float | None = None


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

    from shapechanger.demos.cloning.examples import scaled

    card = policy.card
    inputs: dict[str, Any] = {}
    if card.eyes != "none":
        inputs[_PICTURE] = torch.zeros((2, *card.framing.shape), dtype=torch.uint8)
    if card.state_size:
        inputs[_STATE] = torch.zeros((2, card.state_size))

    class Whole(torch.nn.Module):
        """The network with the scaling of pictures and outputs."""

        def __init__(self) -> None:
            super().__init__()
            self.network = policy.network

        def forward(self, *given: torch.Tensor) -> torch.Tensor:
            named = dict(zip(inputs, given, strict=True))
            picture = named.get(_PICTURE)
            seen = None if picture is None else scaled(picture)
            out = self.network.hands(self.network.perceive(seen, named.get(_STATE)))
            return torch.softmax(out, dim=1) if card.classes else torch.tanh(out)

    whole = OnboardCard(clone=card, body=body, control_hz=control_hz)
    facts = {_CARD: msgspec.json.encode(whole).decode()}
    export_network(Whole(), inputs, _OUTPUT, path, facts)


class OnnxClone:
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
        self._network = OnnxNetwork(path, OnboardCard, _shapes, PolicyError, _CARD)
        whole = self._network.card
        self.card, self.body, self.control_hz = whole.clone, whole.body, whole.control_hz
        self.digest = self._network.digest

    def predict(
        self, picture: NDArray[np.uint8] | None, state: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the action for one picture and state, as `CameraPolicy.predict` does.

        Args:
            picture: Red, green and blue, shape (H, W, 3); None for a policy without pictures.
            state: Shape (k,), NaN for unknown values; None for a policy without a state.

        Returns:
            Action, shape (m,).

        Raises:
            CloningError: If an input is missing or has another shape.
        """
        given: dict[str, NDArray[Any]] = {}
        if self.card.eyes != "none":
            self.card.require_picture(picture)
            given[_PICTURE] = prepare(np.asarray(picture)[np.newaxis], self.card.framing)
        known = self.card.known_states(None if state is None else state[np.newaxis])
        if known is not None:
            given[_STATE] = known
        return self.card.actions(self._network.run(given))[0]

    def act(self, observations: Any) -> NDArray[np.float32]:
        """Return an action for each observation, as `CameraPolicy.act` does."""
        pictures, states = self.card.inputs_of(observations)
        n = len(states if pictures is None else pictures)  # pyright: ignore[reportArgumentType]
        each = [None] * n
        return np.stack(
            [
                self.predict(picture, state)
                for picture, state in zip(
                    each if pictures is None else pictures,
                    each if states is None else states,
                    strict=True,
                )
            ]
        )


def _shapes(whole: OnboardCard) -> dict[str, list[int]]:
    """Return the shapes of inputs and output that a card states."""
    card = whole.clone
    shapes: dict[str, list[int]] = {}
    if card.eyes != "none":
        shapes[_PICTURE] = list(card.framing.shape)
    if card.state_size:
        shapes[_STATE] = [card.state_size]
    return shapes | {_OUTPUT: [card.outputs]}
