"""Interactive figures of the page, as plotly's specifications: temporal diagram and speed curves."""

from __future__ import annotations

import html
import importlib.resources
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from evaluation.runs.folder import Run
from evaluation.views.frames import LogFrames
from evaluation.views.plots.log_rows import Event, events_of
from evaluation.views.plots.speed import curves_of, panels_of, speed_before_t0, speed_style, time_step
from evaluation.views.plots.style import BLACK, BLUE, GREY, MPS_TO_KMH, VERMILLION, WINE
from evaluation.views.plots.temporal import (
    LAYER_HEIGHTS,
    LAYERS,
    STATE_COLOURS,
    arrows_of,
    event_text,
    states_of,
)
from smartmot.types import FloatArray

if TYPE_CHECKING:
    import pandas as pd

_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
_DASHES = {"-": "solid", "--": "dash", ":": "dot"}
_BELOW = {"xaxis": "x2", "yaxis": "y2"}
_ARROW = {
    "text": "", "showarrow": True, "arrowhead": 2, "arrowwidth": 1.2, "arrowcolor": "#444444", "standoff": 5,
    "startstandoff": 5, "xref": "x", "yref": "y", "axref": "x", "ayref": "y",
}  # fmt: skip
_NOTE = {
    "x": 0.03, "y": 0.04, "xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom",
    "showarrow": False,
}  # fmt: skip

_DIAGRAM_PX = 640.0
"""Width of the diagram's axes that names have to fit in; of a narrower page they may come closer."""
_NAME_PX, _MARKER_PX = 6.5, 6.0
"""Mean width of a letter of the names (11 px), and their distance from the marker."""

Spec = dict[str, Any]
"""Figure as plotly.js takes it: `data` and `layout`; or a part of one."""


def plotly_script() -> str:
    """plotly.js with the charts that the page has, scatter alone: what makes it work without network.

    The file is that of plotly.js-basic-dist-min in npm's registry; its licence is LICENSE.plotly.js.
    """
    page = importlib.resources.files("evaluation.views.page")
    return (page / "plotly-basic.min.js").read_text(encoding="utf-8")


def temporal_spec(frames: LogFrames, run: Run) -> Spec:
    """Events of each layer over time, with causes and effects, above the ego's speed."""
    events = events_of(frames.events, LAYERS)
    end = float(frames.time_s[-1])
    speed = frames.ego["speed_mps"].to_numpy(np.float64) * MPS_TO_KMH
    data = [
        {"type": "scatter", "mode": "lines", "x": _rounded([time, until], 3), "y": [LAYER_HEIGHTS[layer]] * 2,
         "line": {"color": STATE_COLOURS[name], "width": 6},
         "hovertemplate": f"{event_text(name)}<br>%{{x:.2f}} s<extra></extra>"}
        for time, until, layer, name in states_of(events, end)
    ]  # fmt: skip
    data.append(_events(events, end))
    data.append(
        {"type": "scatter", "mode": "lines", "x": _rounded(frames.time_s, 3), "y": _rounded(speed, 2),
         "line": {"color": WINE, "width": 2}, "hovertemplate": "%{x:.2f} s: %{y:.1f} km/h<extra></extra>",
         **_BELOW}
    )  # fmt: skip
    data += _marks(frames.time_s, speed, run)
    layout = _layout(330) | {
        "annotations": [
            _ARROW | {"ax": round(cause_s, 3), "ay": LAYER_HEIGHTS[above],
                      "x": round(time_s, 3), "y": LAYER_HEIGHTS[layer]}
            for (cause_s, above, _), (time_s, layer, _) in arrows_of(events)
        ],
        "xaxis": _axis(range=[-0.02 * end, 1.02 * end], matches="x2", showticklabels=False, anchor="y"),
        "xaxis2": _axis("Time (s)", anchor="y2"),
        "yaxis": _axis(
            domain=[0.48, 1.0], range=[-0.7, len(LAYERS) - 0.3], tickvals=list(LAYER_HEIGHTS.values()),
            ticktext=[layer.capitalize() for layer in LAYERS],
        ),
        "yaxis2": _axis(
            "Ego speed (km/h)", domain=[0.0, 0.43], range=[0, 1.2 * max(float(speed.max()), 1.0)], anchor="x2"
        ),
    }  # fmt: skip
    return {"data": data, "layout": layout}


def _events(events: Sequence[Event], end_s: float) -> Spec:
    """Markers, with names where there is room; the name of every one is shown under the pointer."""
    names = [html.escape(event_text(name)) for _, _, name in events]  # plotly reads some HTML
    places = _places(events, end_s)
    instant = [layer == "monitors" for _, layer, _ in events]
    colours = [STATE_COLOURS.get(name, GREY) for _, _, name in events]
    return {
        "type": "scatter", "name": "events", "mode": "markers+text",
        "x": _rounded([time for time, _, _ in events], 3),
        "y": [LAYER_HEIGHTS[layer] for _, layer, _ in events],
        "text": [name if place else "" for name, place in zip(names, places, strict=True)],
        "textposition": [place or "top right" for place in places],
        "hovertext": names,
        "textfont": {"size": 11},
        "marker": {
            "size": 10,
            "symbol": ["x" if over_at_once else "square" for over_at_once in instant],
            "color": [BLUE if over_at_once else c for over_at_once, c in zip(instant, colours, strict=True)],
            "line": {"color": "white", "width": 1},
        },
        "hovertemplate": "%{hovertext}<br>%{x:.2f} s<extra></extra>",
        "cliponaxis": False,
    }  # fmt: skip


def _places(events: Sequence[Event], end_s: float) -> list[str]:
    """Where each name stands, or nothing: between two layers it covers no other name and no arrow."""
    of_px = 1.04 * end_s / _DIAGRAM_PX
    taken: dict[float, list[tuple[float, float]]] = {}
    for (cause_s, above, _), (time_s, layer, _) in arrows_of(events):
        low, high = sorted((LAYER_HEIGHTS[above], LAYER_HEIGHTS[layer]))
        for height in range(low, high):
            taken.setdefault(height + 0.5, []).append((cause_s, time_s))
    places = []
    for time, layer, name in events:
        width = (_NAME_PX * len(event_text(name)) + _MARKER_PX) * of_px
        spans = {"right": (time, time + width), "left": (time - width, time)}
        free = [
            (f"{side} {way}", gap, spans[way])
            for way in ("right", "left")
            for side, gap in (("top", LAYER_HEIGHTS[layer] + 0.5), ("bottom", LAYER_HEIGHTS[layer] - 0.5))
            if spans[way][0] >= -0.02 * end_s and spans[way][1] <= 1.02 * end_s
            if all(spans[way][1] <= low or high <= spans[way][0] for low, high in taken.get(gap, []))
        ]
        place, gap, span = free[0] if free else ("", 0.0, (0.0, 0.0))
        if place:
            taken.setdefault(gap, []).append(span)
        places.append(place)
    return places


def _marks(time_s: FloatArray, speed_kmh: FloatArray, run: Run) -> list[Spec]:
    """Brake request, stop and contact on the speed."""
    last_s = float(time_s[-1])
    end = (
        (run["contact_time_s"], "contact", "circle-open", VERMILLION, "bottom left")
        if run["collided"]
        else (run["t0_s"], "stop", "square-open", BLACK, "middle left")
    )
    return [
        {
            "type": "scatter", "mode": "markers+text",
            "x": [round(float(time), 3)],
            "y": [round(float(np.interp(time, time_s, speed_kmh)), 2)],
            "text": [name],
            "textposition": place if time > 0.5 * last_s else "top right",
            "textfont": {"size": 11},
            "marker": {"symbol": symbol, "size": 10, "color": colour, "line": {"width": 2, "color": colour}},
            "hovertemplate": f"{name}<br>%{{x:.2f}} s, %{{y:.1f}} km/h<extra></extra>",
            "cliponaxis": False,
            **_BELOW,
        }
        for time, name, symbol, colour, place in (
            (run["flag_time_s"], "brake requested", "x-thin", BLACK, "top left"), end,
        )
        if not math.isnan(time)
    ]  # fmt: skip


def speed_specs(
    runs: pd.DataFrame, logs: Mapping[str, pd.DataFrame], *, many: bool = False
) -> list[tuple[str, Spec]]:
    """Speed over the time to stop or contact: title and figure of each panel, a curve per test speed.

    Curves carry the name of their log as `meta`, so that a click can open the run.

    Args:
        runs: table of the runs.
        logs: rows of kind `ego` of their logs.
        many: scenarios share the panels of their strategies, and curves are named by scenario.
    """
    drawn, earliest, top = curves_of(runs, logs)
    if drawn.empty:
        return []
    scenarios = dict(zip(runs["log"], map(str, runs["scenario"]), strict=True))
    panels = []
    for title, rows in panels_of(runs.assign(scenario="") if many else runs):
        chosen = rows[rows.index.isin(drawn.index)].sort_values("v_test_kmh")
        data = []
        for run in chosen.to_dict("records"):
            log = logs[str(run["log"])]
            name = f"{run['v_test_kmh']:g} km/h"
            if many and name not in scenarios[run["log"]]:
                name = f"{scenarios[run['log']]}, {name}"
            elif many:
                name = scenarios[run["log"]]
            data += _speed_curve(run, log, earliest, html.escape(name))
        undrawn = sorted(set(rows["v_test_kmh"]) - set(chosen["v_test_kmh"]))
        note = f"no emergency stop, no contact: {', '.join(f'{speed:g}' for speed in undrawn)} km/h"
        if many:
            undrawn = rows.index.difference(chosen.index).tolist()
            note = f"{len(undrawn)} of {len(rows)} runs end in neither emergency stop nor contact"
        layout = _layout(300) | {
            "xaxis": _axis("Time to stop or contact (s)", range=[earliest, 0.05], dtick=time_step(-earliest)),
            "yaxis": _axis("Ego speed (km/h)", range=[0, top], dtick=10),
            "annotations": [_NOTE | {"text": note}] if undrawn else [],
        }
        panels.append((title, {"data": data, "layout": layout}))
    return panels


def _speed_curve(run: dict[Any, Any], log: pd.DataFrame, earliest_s: float, name: str) -> list[Spec]:
    """Curve of one run under a name, with its brake request and its contact."""
    colour, style = speed_style(float(run["v_test_kmh"]))
    time, speed, flag, contact = speed_before_t0(run, log, earliest_s)
    curve = {"type": "scatter", "meta": str(run["log"])}
    marks = ((flag, "x-thin", "brake requested"), (contact, "circle-open", "contact"))
    return [
        curve | {
            "mode": "lines", "x": _rounded(time, 3), "y": _rounded(speed, 2),
            "line": {"color": colour, "dash": _DASHES[style], "width": 2},
            "hovertemplate": f"{name}: %{{y:.1f}} km/h at %{{x:.2f}} s<extra></extra>",
        },
        *(
            curve | {
                "mode": "markers", "x": [round(point[0], 3)], "y": [round(point[1], 2)],
                "marker": {
                    "symbol": symbol, "size": 9, "color": colour, "line": {"width": 2.5, "color": colour},
                },
                "hovertemplate": f"{name}: {event}, %{{y:.1f}} km/h at %{{x:.2f}} s<extra></extra>",
                "cliponaxis": False,
            }
            for point, symbol, event in marks
            if point is not None
        ),
    ]  # fmt: skip


def _layout(height_px: int) -> Spec:
    return {
        "height": height_px, "showlegend": False, "margin": {"l": 70, "r": 14, "t": 10, "b": 44},
        "font": {"family": _FONT, "size": 12, "color": "#222222"}, "paper_bgcolor": "white",
        "plot_bgcolor": "white", "hovermode": "closest",
    }  # fmt: skip


def _axis(title: str | None = None, **more: Any) -> Spec:
    axis = {"gridcolor": "#e6e6e6", "zeroline": False, "linecolor": "#999999", "automargin": True}
    return axis | ({} if title is None else {"title": {"text": title}}) | more


def _rounded(values: ArrayLike, digits: int) -> list[float]:
    rounded: list[float] = np.round(np.asarray(values, dtype=np.float64), digits).tolist()
    return rounded
