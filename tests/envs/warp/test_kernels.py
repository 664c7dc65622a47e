"""Kernels compile for a GPU on a machine without one."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import gpu_kernels
from shapechanger.envs.warp import noise, patches
from shapechanger.envs.warp.devices import wp


@pytest.mark.parametrize("module", [noise, patches], ids=["noise", "patches"])
def test_our_kernels_compile_for_an_h100(module: object, tmp_path: Path) -> None:
    """CUDA's compiler accepts them, which is stricter than the one for CPUs."""
    files = wp.compile_aot_module(module, arch=90, module_dir=tmp_path, use_ptx=False)
    assert any(file.suffix == ".cubin" for file in files)


@pytest.mark.slow
def test_all_kernels_of_the_trial_compile_for_an_h100(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So do mujoco-warp's, with the functions of ours inside them."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    modules = gpu_kernels.launched()
    assert len(modules) > 50
    for module, block in modules:
        assert gpu_kernels.compiled(module, block), module.name
