"""Behaviour cloning: driving policies learned from images, states and the actions of a driver.

```
learn.learn           learn any actions from any demonstrations (`shapechanger demos train`)
network.CameraPolicy  predict, save and export
clone.Clone           the same from ONNX, without PyTorch
evaluation.evaluate   compare a policy with a driver on held-out steps
sb3                   continue with reinforcement learning in Stable-Baselines3
```

This package imports no modules, so that settings can be read without PyTorch.
"""
