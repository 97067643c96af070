"""Traffic that reacts: vehicles and pedestrians of SUMO around the ego, in step with the engine."""

from scenarios.traffic.background import SumoTraffic
from scenarios.traffic.demand import Traffic, with_traffic

__all__ = ["SumoTraffic", "Traffic", "with_traffic"]
