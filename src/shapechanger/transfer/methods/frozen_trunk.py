"""Fine-tune with a frozen trunk: only the layers that depend on the body learn."""

from __future__ import annotations

from typing import Any, cast

from stable_baselines3.common.callbacks import BaseCallback
from torch import nn

from shapechanger.contract.env_ref import EnvTraits
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.methods import Method, MethodRun

_LEAST_LAYERS = 2
_PPO = f"PPO with at least {_LEAST_LAYERS} hidden layers"


class FrozenTrunk(Method):
    """Fine-tune the first and the last layer of the policy, and keep those between.

    The first layer reads the body's sensors and the last one moves its motors; the layers between
    hold the skill, as far as it is independent of the body. The whole value network learns.
    """

    name = "frozen-trunk"
    needs = (("on-policy", _PPO), ("callback", "PPO on the CPU"))
    paper = "C. Devin and others, Learning Modular Neural Network Policies, ICRA 2017"

    def require(self, source: EnvTraits, target: EnvTraits, settings: LearnerSettings) -> None:
        """Refuse learners without what it needs, and networks without a layer in the middle."""
        super().require(source, target, settings)
        if len(cast("Any", settings).net_arch) < _LEAST_LAYERS:
            raise self._lacks(_PPO)

    def learn(self, run: MethodRun) -> Any:
        """Train on the target, starting from the source policy."""
        return run.fine_tune(callback=_Freeze())


class _Freeze(BaseCallback):
    """Excludes the hidden layers after the first from the optimiser's steps."""

    def _on_training_start(self) -> None:
        hidden = cast("Any", self.model.policy).mlp_extractor.policy_net
        linear = [layer for layer in hidden if isinstance(layer, nn.Linear)]
        for layer in linear[1:]:
            layer.requires_grad_(False)

    def _on_step(self) -> bool:
        return True
