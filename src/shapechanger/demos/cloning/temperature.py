"""How sure a policy may be: one number that its logits are divided by.

C. Guo and others, On calibration of modern neural networks, ICML 2017.
"""

from __future__ import annotations

from typing import Final

import torch
from torch import Tensor
from torch.nn import functional

__all__ = ["best_temperature"]

# From twice as sure as the network was to a fifth.
_TEMPERATURES: Final = torch.logspace(-0.3, 0.7, 101)
_FEWEST: Final = 20


def best_temperature(logits: Tensor, wanted: Tensor) -> float:
    """The temperature at which what was not learned from is the least surprise.

    Args:
        logits: Shape (n, classes).
        wanted: Numbers of the classes, shape (n,).

    Returns:
        1 where fewer than 20 steps say anything.
    """
    if len(wanted) < _FEWEST:
        return 1.0
    losses = [float(functional.cross_entropy(logits / t, wanted)) for t in _TEMPERATURES]
    return float(_TEMPERATURES[int(torch.tensor(losses).argmin())])
