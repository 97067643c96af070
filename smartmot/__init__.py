"""Map-aware perception for automatic emergency braking: filter, track, forecast, decide.

All positions are in the map frame (OpenDRIVE's inertial frame), SI units and radians.
"""
