"""Compile the kernels of the trial of a GPU on a machine without one.

    python -m benchmarks.gpu_kernels

The kernels are stored in Warp's cache (`WARP_CACHE_PATH`). If the cache is copied to the machine
with the GPU, its first steps need no compilation. Warp includes the compiler for GPUs.
"""

from __future__ import annotations

import sys
import time
from typing import Any, Final

import torch

from benchmarks import gpu
from shapechanger.contract.env_ref import each_body
from shapechanger.envs.warp.devices import wp
from shapechanger.morphology import Stretch
from shapechanger.transfer.limbs.envs import together

# Compute capability 9.0: H100 and H200.
ARCHITECTURE: Final = 90
_BLOCK: Final = 256


def launched() -> set[tuple[Any, int]]:
    """Return the modules and block sizes of the kernels that the trial launches.

    The trial runs with few worlds on Warp's CPU device, which launches the same kernels.
    """
    found: set[tuple[Any, int]] = set()
    launch, launch_tiled = wp.launch, wp.launch_tiled
    inside = [0]

    def note(kernel: Any, block: int | None) -> None:
        found.add((kernel.module, block or _BLOCK))

    def noted(kernel: Any, *arguments: Any, **more: Any) -> Any:
        if not inside[0]:
            note(kernel, more.get("block_dim"))
        return launch(kernel, *arguments, **more)

    def noted_tiled(kernel: Any, *arguments: Any, **more: Any) -> Any:
        note(kernel, more["block_dim"])
        inside[0] += 1  # This function calls `launch` with the block size of a CPU.
        try:
            return launch_tiled(kernel, *arguments, **more)
        finally:
            inside[0] -= 1

    wp.launch, wp.launch_tiled = noted, noted_tiled
    try:
        gpu.rollouts("cpu")
        envs = gpu.made("Ant", 4, "cpu", pool=["Ant", [Stretch("shank_*", 1.1)]])
        envs.step(gpu.actions(envs, 1)[0])
        # Drawn ants differ in their number of joints.
        drawn = each_body(gpu.ANT.having({"bodies": gpu.GENERALIST_BODIES}))
        envs = gpu.made("Ant", len(drawn), "cpu", **together(drawn).kwargs)
        envs.step([torch.zeros(space.shape) for space in envs.action_space])
    finally:
        wp.launch, wp.launch_tiled = launch, launch_tiled
    return found


def compiled(module: Any, block: int) -> bool:
    """Compile a module for the GPU; return whether its result was not yet in the cache."""
    module.get_module_hash(block)
    options = module.resolved_options[block]
    return bool(module._compile(output_arch=ARCHITECTURE, use_ptx=False, options=options))


if __name__ == "__main__":
    began = time.monotonic()
    modules = launched()
    new = sum(compiled(*each) for each in modules)
    took = time.monotonic() - began
    sys.stdout.write(f"{len(modules)} modules, {new} of them compiled now, in {took:.0f} s.\n")
