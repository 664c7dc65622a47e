"""Behaviour cloning: driving policies learned from images, states and the actions of a driver.

`learn.learn` returns a `network.CameraPolicy`; its base class, `clone.Clone`, also runs ONNX files.
This file imports no modules, so that settings can be read without PyTorch.
"""
