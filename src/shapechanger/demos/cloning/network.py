"""Cloned policies of PyTorch: encoders for images and states, and a linear output layer.

The names of the attributes (`eyes`, `nerves`, `hands`, ...) name the weights in the file of
a policy, and must not change.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.cloning.clone import Clone, CloneSettings, clone_of, prepared
from shapechanger.errors import MissingExtra
from shapechanger.layout import Layout
from shapechanger.onnx_file import export_network
from shapechanger.policy import STEERING, CloneNetwork, PolicyCard

try:
    import torch
    from torch import Tensor, nn
    from torch.nn import functional
except ImportError as error:
    raise MissingExtra("torch", "learn") from error

DIRECTIONS: Final = 6
"""Number of edge directions over half a turn: 30 degrees each."""

BRIGHTEST: Final = 255.0
"""Largest value of a pixel."""
_CHUNK: Final = 256  # Examples at a time, to bound the memory.
_CELL: Final = 4  # Side of a cell, pixels.
# Added before the logarithm, as a share of full brightness: about a camera's noise in the dark.
_DARK: Final = 8.0 / 255.0
# Mean strength of an edge that is only noise; keeps uniform images from being amplified.
_MIN_EDGE: Final = 1e-4
# About the noise of a camera, as a share of full brightness; keeps a uniform image, such as that
# of a covered lens, from being amplified into noise.
_MIN_SPREAD: Final = 0.02
_MAX_DEVIATIONS: Final = 5.0  # Larger deviations of a state value carry no more information.


def edges(pictures: Tensor, cells: tuple[int, int]) -> Tensor:
    """Return the strength of the edges of each direction in each cell, relative to their mean.

    Images are in [0, 1], shape (n, 3, height, width); strengths are at least 0, shape
    (n, DIRECTIONS, rows, columns) for the given rows and columns of cells.
    """
    light = torch.log(pictures.mean(dim=1, keepdim=True) + _DARK)
    across = functional.pad(light[..., 2:] - light[..., :-2], (1, 1, 0, 0))
    down = functional.pad(light[..., 2:, :] - light[..., :-2, :], (0, 0, 1, 1))
    strength = torch.hypot(across, down)
    # Opposite directions belong to the same edge.
    turn = torch.remainder(torch.atan2(down, across), math.pi) * (DIRECTIONS / math.pi)
    apart = (turn - torch.arange(DIRECTIONS, device=turn.device).view(1, -1, 1, 1)).abs()
    share = (1.0 - torch.minimum(apart, DIRECTIONS - apart)).clamp(min=0.0)
    pooled = functional.adaptive_avg_pool2d(strength * share, cells)
    return torch.sqrt(pooled / (pooled.mean(dim=(1, 2, 3), keepdim=True) + _MIN_EDGE))


class Eyes(nn.Module):
    """Encoder of an image by its colours or edges.

    Colours are normalised by the mean and standard deviation of their image, so that neither
    daylight nor exposure matters.
    """

    def __init__(self, net: CloneNetwork) -> None:
        super().__init__()
        framing, by_edges = net.framing, net.eyes == "edges"
        self._cells: tuple[int, int] | None = None
        height, width, before = framing.shape
        if by_edges:
            height, width = max(height // _CELL, 1), max(width // _CELL, 1)
            self._cells, before = (height, width), DIRECTIONS
        layers: list[nn.Module] = []
        for i, after in enumerate(net.channels):
            # The first filters of colours are wider, to find edges.
            side = 3 if i or by_edges else 5
            layers += [nn.Conv2d(before, after, side, stride=2, padding=side // 2), nn.ReLU()]
            height, width, before = (height + 1) // 2, (width + 1) // 2, after
        self.filters = nn.Sequential(*layers)
        self.boiled_down = nn.Linear(before * height * width, net.features)

    def forward(self, pictures: Tensor) -> Tensor:
        """Return the features, shape (n, features), of images in [0, 1], (n, 3, height, width)."""
        if self._cells is not None:
            seen = edges(pictures, self._cells) - 1.0
        else:
            # Colours are last in memory, so that each image is one row: several times faster than
            # over three dimensions.
            rows = pictures.permute(0, 2, 3, 1).flatten(1)
            spread, mean = (x[:, None, None, None] for x in torch.std_mean(rows, dim=1))
            seen = (pictures - mean) / (spread + _MIN_SPREAD)
        return torch.relu(self.boiled_down(self.filters(seen).flatten(1)))


class Nerves(nn.Module):
    """Encoder of a state.

    Each value is normalised by the mean and standard deviation in the demonstrations. A missing
    value (NaN) is replaced by the mean and flagged in a second input; outliers are clipped at five
    standard deviations.

    Args:
        size: Number of values in a state.
        widths: Widths of the layers; the last one is the number of features.
    """

    def __init__(self, size: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        self.register_buffer("middle", torch.zeros(size))
        self.register_buffer("spread", torch.ones(size))
        layers: list[nn.Module] = []
        before = 2 * size
        for after in widths:
            layers += [nn.Linear(before, after), nn.ReLU()]
            before = after
        self.layers = nn.Sequential(*layers)

    def forward(self, states: Tensor) -> Tensor:
        """Return the features, shape (n, widths[-1]), of states, shape (n, size)."""
        missing = states.isnan()
        known = (states - cast("Tensor", self.middle)) / cast("Tensor", self.spread)
        known = torch.where(missing, 0.0, known.clamp(-_MAX_DEVIATIONS, _MAX_DEVIATIONS))
        return self.layers(torch.cat((known, missing.float()), dim=1))


class _Several(nn.ModuleList):
    """Modules with concatenated outputs."""

    def forward(self, x: Tensor) -> Tensor:
        return torch.cat([one(x) for one in self], dim=1)


class CameraNetwork(nn.Module):
    """Network of a clone: encoders and output layer, as the card describes them."""

    def __init__(self, card: PolicyCard) -> None:
        super().__init__()
        net = clone_of(card)
        sees, feels = net.eyes != "none", card.observation
        eyes = [Eyes(net) for _ in range(net.members if sees else 0)]
        nerves = [Nerves(feels.size, net.nerves) for _ in range(net.members) if feels is not None]
        self.eyes: nn.Module | None = _one_or_several(eyes)
        self.nerves: nn.Module | None = _one_or_several(nerves)
        features = len(eyes) * net.features + (len(nerves) * net.nerves[-1] if nerves else 0)
        self.hands = nn.Linear(features, len(net.classes) or card.action_size)
        # With colours last in memory, convolutions of a single image are a third faster.
        self.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]

    def perceive(self, pictures: Tensor | None, states: Tensor | None = None) -> Tensor:
        """Return the features, shape (n, features), of inputs of the encoders."""
        given = ((self.eyes, pictures), (self.nerves, states))
        found = [encoder(part) for encoder, part in given if encoder is not None]
        return found[0] if len(found) == 1 else torch.cat(found, dim=1)


def _one_or_several(parts: Sequence[nn.Module]) -> nn.Module | None:
    if len(parts) < 2:
        return parts[0] if parts else None
    return _Several(parts)


class CameraPolicy(Clone):
    """A clone for images, states or both.

    Attributes:
        network: The network.
        card: Architecture and origin.
    """

    def __init__(self, network: CameraNetwork, card: PolicyCard) -> None:
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
        clone = CloneNetwork(
            framing=settings.framing,
            channels=settings.channels,
            features=settings.features,
            eyes=settings.eyes,
        )
        return cls.blank(PolicyCard(learner="cloning", action=actions, clone=clone), seed)

    @classmethod
    def blank(cls, card: PolicyCard, seed: int) -> CameraPolicy:
        """Return an untrained policy with the architecture of a card and weights of a seed."""
        with seeded(seed):
            return cls(CameraNetwork(card), card)

    @classmethod
    def of_file(cls, card: PolicyCard, weights: Mapping[str, NDArray[Any]]) -> CameraPolicy:
        """Return the policy of a file, see `shapechanger.load_policy`."""
        # On the meta device a forged card cannot allocate memory before the sizes are compared.
        with torch.device("meta"):
            network = CameraNetwork(card)
        state = {name: torch.from_numpy(value.copy()) for name, value in weights.items()}  # pyright: ignore[reportUnknownMemberType]
        network.load_state_dict(state, assign=True)
        # Assigned weights keep the memory layout of the file, so that sums have the same order.
        network.to(memory_format=torch.channels_last)  # pyright: ignore[reportCallIssue]
        for name, value in weights.items():
            if value.dtype != np.float32 or not np.isfinite(value).all():
                raise ValueError(f"its weights {name} must be finite and in single precision")
        settings = msgspec.convert(card.settings, CloneSettings | None)
        return cls(network, msgspec.structs.replace(card, settings=settings))

    def tensors(self) -> dict[str, NDArray[Any]]:
        """Return its weights, keyed by name."""
        return {name: value.numpy() for name, value in self.network.state_dict().items()}

    def outputs(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> NDArray[np.float32]:
        """Return the outputs of the network, as `Clone` describes them."""
        return _activated(self.logits(pictures, states), self.net).numpy()

    def logits(
        self, pictures: NDArray[np.uint8] | None, states: NDArray[np.floating] | None = None
    ) -> Tensor:
        """Return the outputs of the last layer, from which `outputs` are computed."""
        small, states = prepared(self.card, pictures, states)
        known = None if states is None else torch.as_tensor(states)
        n = len(small) if small is not None else len(known) if known is not None else 0
        found = torch.empty(n, self.network.hands.in_features)
        with torch.inference_mode():
            for start in range(0, n, _CHUNK):
                some = slice(start, start + _CHUNK)
                found[some] = self.network.perceive(
                    None if small is None else scaled(torch.as_tensor(small[some].copy())),
                    None if known is None else known[some],
                )
            return self.network.hands(found)

    def copy(self) -> CameraPolicy:
        """Return a policy that shares no weights with this one."""
        return CameraPolicy(copy.deepcopy(self.network), self.card)

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
        net = msgspec.structs.replace(self.net, body=body, control_hz=control_hz)
        card = msgspec.structs.replace(self.card, clone=net)
        kinds = {"picture": torch.uint8, "state": torch.float32}
        inputs = {
            name: torch.zeros((2, *shape), dtype=kinds[name])
            for name, shape in card.shapes.items()
            if name in kinds
        }
        export_network(_Whole(self.network, net, tuple(inputs)), inputs, card, path)


class _Whole(nn.Module):
    """A network with the scaling of images and outputs."""

    def __init__(self, network: CameraNetwork, net: CloneNetwork, inputs: tuple[str, ...]) -> None:
        super().__init__()
        self.network, self.net, self.inputs = network, net, inputs

    def forward(self, *given: Tensor) -> Tensor:
        named = dict(zip(self.inputs, given, strict=True))
        seen = scaled(named["picture"]) if "picture" in named else None
        out = self.network.hands(self.network.perceive(seen, named.get("state")))
        return _activated(out, self.net)


def _activated(out: Tensor, net: CloneNetwork) -> Tensor:
    """Return probabilities of classes, or actions in [-1, 1], for outputs of the last layer."""
    return torch.softmax(out, dim=1) if net.classes else torch.tanh(out)


def scaled(pictures: Tensor) -> Tensor:
    """Return images in [0, 1], shape (n, 3, height, width), of uint8 (n, height, width, 3)."""
    return pictures.permute(0, 3, 1, 2).float() / BRIGHTEST


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


def joined(card: PolicyCard, members: list[CameraNetwork]) -> CameraNetwork:
    """Return one network, as a card describes it, whose output is the mean of its members."""
    network = CameraNetwork(card)
    for name in ("eyes", "nerves"):
        several = getattr(network, name)
        if several is not None:
            for one, member in zip(several, members, strict=True):
                one.load_state_dict(getattr(member, name).state_dict())
    seen = clone_of(card).features if network.eyes is not None else 0
    weights = [member.hands.weight for member in members]
    parts = [weight[:, :seen] for weight in weights] + [weight[:, seen:] for weight in weights]
    with torch.no_grad():
        network.hands.weight.copy_(torch.cat(parts, dim=1) / len(members))
        network.hands.bias.copy_(torch.stack([member.hands.bias for member in members]).mean(dim=0))
    return network
