"""Transplant a trained policy into the shapes of another body, to continue training there.

A body map is affine, and so are the first and the last layer of a network: the first layer absorbs
the map of observations, and the last layer the map of actions. Before any training the transplanted
policy does in the target what the source policy does through the map, up to rounding; new inputs
start with weights of zero and are trainable.

`transplant` moves a model of Stable-Baselines3, and `transplant_normalisation` the statistics that
its observations are normalised by.
"""

try:
    import stable_baselines3  # noqa: F401  # pyright: ignore[reportUnusedImport]
    import torch  # noqa: F401  # pyright: ignore[reportUnusedImport]
except ImportError as error:
    from shapechanger.errors import MissingExtra

    raise MissingExtra("torch and stable-baselines3", "learn") from error

from shapechanger.transfer.transplant.layers import transplant_normalisation
from shapechanger.transfer.transplant.model import transplant

__all__ = ["transplant", "transplant_normalisation"]
