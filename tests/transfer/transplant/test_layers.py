"""Layers of transplanted networks, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.spaces import Box

from shapechanger.errors import TransplantError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Hold
from shapechanger.transfer.transplant.layers import critic_actions, squashed_outputs
from tests.transfer.body_map.bodies import pendulum_observation


def test_squashed_outputs_by_hand() -> None:
    """Ranges off 0, in the units of the env: copies, and constants inside and at the end."""
    sensing = pendulum_observation(), pendulum_observation()
    ours = (("a", 0.0, 2.0), ("b", 2.0, 6.0), ("high", 1.0, 3.0), ("low", -3.0, -1.0))
    theirs = (("a", 0.0, 2.0), ("held", 0.0, 8.0), ("b", 2.0, 6.0), ("end", 0.0, 8.0))
    source, target = (
        Layout(tuple(Feature(name, "1", low, high) for name, low, high in side))
        for side in (ours, theirs)
    )
    body_map = BodyMap.between(
        *sensing, source, target, rules={"held": Hold(6.0), "end": Hold(0.0)}
    )
    spaces = [Box(side.low.astype("f"), side.high.astype("f")) for side in (source, target)]
    outputs = squashed_outputs(body_map, *spaces)
    np.testing.assert_array_equal(outputs.mean.matrix[[0, 2], [0, 1]], [1.0, 1.0])
    np.testing.assert_allclose(
        outputs.mean.offset, np.arctanh([0.0, 0.5, 0.0, -1.0 + 1e-6]), rtol=1e-9
    )
    matrix, still = critic_actions(body_map, outputs, spaces[0])
    np.testing.assert_array_equal(matrix.any(axis=1), [True, True, False, False])
    np.testing.assert_array_equal(still, [0.0, 0.0, -1.0, 1.0])
    shifted = Layout((*target.features[:2], Feature("b", "1", 3.0, 7.0), target["end"]))
    body_map = BodyMap.between(*sensing, source, shifted, otherwise="hold")
    box = Box(shifted.low.astype("f"), shifted.high.astype("f"))
    with pytest.raises(TransplantError, match=r"become \+1 times the target's, shifted by -0\.5,"):
        squashed_outputs(body_map, spaces[0], box)
