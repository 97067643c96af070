"""Learned detectors of road users: clouds as pillars, networks as ONNX files, boxes from centres."""

from smartmot.lidar.learned.decoding import CHANNELS, Decoder
from smartmot.lidar.learned.detector import detect_learned
from smartmot.lidar.learned.network_file import LearnedConfig
from smartmot.lidar.learned.pillars import FEATURES, PillarGrid, Pillars, pillars_of
from smartmot.lidar.learned.shipped import SHIPPED, shipped_card, shipped_network, shipped_path

__all__ = [
    "CHANNELS", "FEATURES", "SHIPPED", "Decoder", "LearnedConfig", "PillarGrid", "Pillars", "detect_learned",
    "pillars_of", "shipped_card", "shipped_network", "shipped_path",
]  # fmt: skip
