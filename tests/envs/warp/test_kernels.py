"""Kernels compile for a GPU on any machine, and mujoco-warp still needs the replaced functions."""

# Warp reads the annotations, so they must not become strings.
# pyright: basic, reportInvalidTypeForm=false

import dataclasses
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from benchmarks import gpu_kernels
from shapechanger.envs.warp import kernels
from shapechanger.envs.warp.devices import mjw, wp
from shapechanger.errors import VectorEnvError

_original: Any = mjw._src.collision_primitive_core.plane_capsule
_ours: Any = kernels.plane_capsule
_AXIS = np.array([np.sin(0.2) * np.cos(0.7), np.sin(0.2) * np.sin(0.7), np.cos(0.2)])
_CAPSULE = f"""
<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body pos="0 0 0.3"><freejoint/>
<geom type="capsule" size="0.1" fromto="0 0 0 {" ".join(str(x) for x in -0.25 * _AXIS)}"/>
</body></worldbody></mujoco>
"""


def test_our_kernels_compile_for_an_h100(tmp_path: Path) -> None:
    """CUDA's compiler, which is stricter than the compiler for CPUs, accepts our kernels."""
    files = wp.compile_aot_module(kernels, arch=90, module_dir=tmp_path, use_ptx=False)
    assert any(file.suffix == ".cubin" for file in files)


@pytest.mark.slow
def test_all_launched_kernels_compile_for_an_h100(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All kernels compile, including mujoco-warp's with the functions that we replace."""
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    modules = gpu_kernels.launched()
    assert len(modules) > 50
    for module, block in modules:
        assert gpu_kernels.compiled(module, block), module.name


@wp.kernel
def _both(axis: wp.vec3, frames: wp.array[wp.mat33]):
    up, zero = wp.vec3(0.0, 0.0, 1.0), wp.vec3(0.0, 0.0, 0.0)
    _dist, _pos, theirs = _original(up, zero, zero, axis, 0.1, 0.1)
    _dist2, _pos2, ours = _ours(up, zero, zero, axis, 0.1, 0.1)
    frames[0] = theirs
    frames[1] = ours


def test_a_steep_capsule_still_needs_our_contacts() -> None:
    """Our contacts have MuJoCo's axes; delete `plane_capsule` once mujoco-warp's have them too."""
    model = mujoco.MjModel.from_xml_string(_CAPSULE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    frames = wp.zeros(2, dtype=wp.mat33, device="cpu")
    wp.launch(_both, dim=1, inputs=[wp.vec3(*_AXIS)], outputs=[frames], device="cpu")
    theirs, ours = np.abs(frames.numpy().reshape(2, 9))
    expected = np.abs(data.contact.frame[0])
    np.testing.assert_allclose(ours, expected, atol=1e-5)
    assert np.abs(theirs - expected).max() > 0.1


def test_moment_arms_are_still_kept_once() -> None:
    """Once mujoco-warp keeps arms for each world, the tendons of `kernels` can be deleted."""
    fields: Any = dataclasses.fields(mjw.Model)
    arms = next(field for field in fields if field.name == "wrap_prm")
    assert arms.type.shape[0] != "*"


def test_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "version", lambda name: "4.1.0")
    with pytest.raises(VectorEnvError, match=r"mujoco-warp 4\.0\.x, and 4\.1\.0 is installed"):
        kernels.follow_mujoco()
