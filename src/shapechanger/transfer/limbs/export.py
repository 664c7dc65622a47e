"""Policies of limbs as ONNX, for one body each: its rows are constants of the graph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
from torch import nn

from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.limbs.envs import fitted
from shapechanger.transfer.limbs.policy import LimbNetwork
from shapechanger.transfer.limbs.rows import DESCRIBED
from shapechanger.transfer.onnx_policy import OnnxCard, OnnxGraph
from shapechanger.transfer.versions import identities_in


def export_limbs(policy: TrainedPolicy, env: gym.Env[Any, Any], ref: EnvRef, path: Path) -> None:
    """Write a policy of limbs as ONNX for one body, from its own observations to its own actions.

    Args:
        policy: The policy.
        env: The env of the body.
        ref: The same env, for the card.
        path: The file.

    Raises:
        MissingExtra: If onnx is not installed.
        TransplantError: If the body belongs to another family than the policy's.
        StudyError: If it has more limbs than the policy has room for.
        OutputError: If the file cannot be written.
    """
    settings: Any = policy.card.settings
    rows = fitted(env, policy.card.observation, settings.room).rows
    graph = OnnxGraph()
    last = graph.apply("Add", graph.apply("Mul", "observation", rows.scale), rows.offset)
    last = graph.apply("Add", graph.apply("MatMul", last, rows.selection), rows.constant)
    last = graph.as_float(last)
    net: Any = policy.model.policy
    if isinstance(net.actor_net, LimbNetwork):
        shape = np.array([-1, rows.room + 1, rows.columns.width])
        last = _limb_actions(graph, graph.apply("Reshape", last, shape), net.actor_net)
    else:
        last = _layers(graph, last, net.actor_net.layers)
    one = np.array(1.0, np.float32)
    last = graph.apply("Clip", last, -one, one)
    last = graph.apply("Gather", last, rows.actuators.astype(np.int64), axis=1)
    half = (0.5 * (rows.high - rows.low)).astype(np.float32)
    last = graph.apply("Mul", graph.apply("Add", last, one), half)
    graph.apply("Add", last, rows.low.astype(np.float32), to="action")
    observation, action = layouts_of(env)
    card = msgspec.convert(policy.card, OnnxCard, from_attributes=True)
    identity = identities_in(ref, env, settings)
    graph.write(
        path,
        msgspec.structs.replace(
            card, env=ref, observation=observation, action=action, identity=identity
        ),
    )


def _limb_actions(graph: OnnxGraph, rows: str, net: Any) -> str:
    """Add a `LimbNetwork` on rows, shape (n, 1 + limbs, width); return its actions (n, limbs)."""
    trunk = graph.apply("Gather", rows, np.array(0), axis=1)
    end = np.array([2**31 - 1])
    limbs = graph.apply("Slice", rows, np.array([1]), end, np.array([1]))
    description = graph.apply("Slice", limbs, np.array([0]), np.array([DESCRIBED]), np.array([2]))
    code = _layers(graph, limbs, net.encode)
    weight = graph.apply("Softmax", _layers(graph, description, net.weigh), axis=1)
    summed = graph.apply("Mul", weight, code)
    summed = graph.apply("ReduceSum", summed, np.array([1]), keepdims=0)
    core = graph.apply("Concat", _layers(graph, trunk, net.trunk), summed, axis=1)
    core = graph.apply("Unsqueeze", _layers(graph, core, net.core), np.array([1]))
    # The first layer of the decoder, on each of the parts that it joins.
    first, *others = net.decode
    whole = first.weight.detach().numpy().T
    sizes = np.cumsum([net.core[0][-1].out_features, net.encode[0][-1].out_features])
    parts = [
        graph.apply("MatMul", part, weights)
        for part, weights in zip((core, code, description), np.split(whole, sizes), strict=True)
    ]
    last = graph.apply("Add", graph.apply("Add", parts[0], parts[1]), parts[2])
    last = graph.apply("Add", last, first.bias.detach().numpy())
    return graph.apply("Squeeze", _layers(graph, last, others), np.array([2]))


def _layers(graph: OnnxGraph, last: str, layers: Any) -> str:
    """Add linear layers and tanh in their order; return the output."""
    for layer in layers:
        if isinstance(layer, nn.Linear):
            weight, bias = (each.detach().numpy() for each in (layer.weight, layer.bias))
            last = graph.apply("Add", graph.apply("MatMul", last, weight.T), bias)
        elif isinstance(layer, nn.Tanh):
            last = graph.apply("Tanh", last)
        else:
            last = _layers(graph, last, layer)
    return last
