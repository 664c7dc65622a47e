"""Behaviour cloning: driving policies learned from images, states and the actions of a driver.

`learn.learn` returns a `network.CameraPolicy`; `clone.Clone` is a policy from ONNX. This package
imports no modules, so that settings can be read without PyTorch.
"""
