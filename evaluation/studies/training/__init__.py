"""Training of learned detectors, and the files that come of it."""

NETWORK = "network.onnx"
"""Of a training's folder; whoever only copies it needs no PyTorch."""
