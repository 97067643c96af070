"""Training of learned detectors, and the files that come of it."""

NETWORK = "network.onnx"
"""Of a training's folder; whoever only copies it needs no PyTorch."""

CALIBRATION_CLOUDS = 300
"""By which the ranges of integers are found, unless others are asked for."""
