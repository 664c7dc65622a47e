"""Transplant a trained policy into the shapes of another body, to continue training there.

A body map is affine, and so are the first and the last layer of a network. The first layer absorbs
the map of observations, and the last layer absorbs the map of actions. Before training, the
transplanted policy acts like the source policy through the map, up to rounding, except in actions
with the rule `learn` and for clipped inputs. Weights of new inputs start at zero and are trainable.

`transplant` moves a model of Stable-Baselines3, and `transplant_normalisation` moves the statistics
that normalise its observations.
"""

from shapechanger.errors import needing_extra

with needing_extra("learn"):
    import stable_baselines3  # noqa: F401  # pyright: ignore[reportUnusedImport]
    import torch  # noqa: F401  # pyright: ignore[reportUnusedImport]

from shapechanger.transfer.transplant.layers import transplant_normalisation
from shapechanger.transfer.transplant.model import transplant

__all__ = ["transplant", "transplant_normalisation"]
