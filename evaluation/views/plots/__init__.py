"""Pictures of runs: the sequence of events, speed before stop or contact, the view from above, the map.

Every function returns a `matplotlib.figure.Figure` that is the caller's alone: no pyplot, no global state.
Sizes are chosen so that the texts stay readable when a figure is printed 85 mm wide. Colours are safe for
colour-blind readers (Okabe and Ito) and mean the same in every picture.
"""

from evaluation.views.plots.birdseye import birdseye, map_picture
from evaluation.views.plots.speed import speed_curves, speed_style
from evaluation.views.plots.temporal import temporal_diagram

__all__ = ["birdseye", "map_picture", "speed_curves", "speed_style", "temporal_diagram"]
