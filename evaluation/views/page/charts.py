"""Interactive figures of the page, as plotly's specifications: temporal diagram and speed curves."""

from __future__ import annotations

import html
import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.runs.folder import Run
from evaluation.views.frames import LogFrames
from evaluation.views.plots.speed import panels_of, speed_before_t0, speed_style, time_step
from evaluation.views.plots.style import BLACK, BLUE, GREY, MPS_TO_KMH, VERMILLION, WINE
from evaluation.views.plots.temporal import LAYERS, STATE_COLOURS, Event, event_text, latest_cause

if TYPE_CHECKING:
    import pandas as pd

_FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', Arial, sans-serif"
_DASHES = {"-": "solid", "--": "dash", ":": "dot"}
_EARLIEST_S = -1.5
"""Speed curves begin at least this long before stop or contact, as figure 5 of the paper does."""


_BELOW = {"xaxis": "x2", "yaxis": "y2"}
_ARROW = {
    "text": "", "showarrow": True, "arrowhead": 2, "arrowwidth": 1.2, "arrowcolor": "#444444", "standoff": 5,
    "startstandoff": 5, "xref": "x", "yref": "y", "axref": "x", "ayref": "y",
}  # fmt: skip
_NOTE = {
    "x": 0.03, "y": 0.04, "xref": "paper", "yref": "paper", "xanchor": "left", "yanchor": "bottom",
    "showarrow": False,
}  # fmt: skip

Spec = dict[str, Any]
"""Figure as plotly.js takes it: `data` and `layout`."""


def plotly_script() -> str:
    """plotly.js, whole: what makes the page work without network."""
    from plotly.offline import get_plotlyjs  # type: ignore[import-untyped]

    return str(get_plotlyjs())


def temporal_spec(frames: LogFrames, run: Run) -> Spec:
    """Events of each layer over time, with causes and effects, above the ego's speed."""
    height = {layer: len(LAYERS) - 1 - rank for rank, layer in enumerate(LAYERS)}
    events: list[Event] = [
        (float(time), str(layer), str(name))
        for time, layer, name in zip(
            frames.events["time_s"], frames.events["category"], frames.events["label"], strict=True
        )
        if layer in height
    ]
    end = float(frames.time_s[-1])
    data = []
    for layer in LAYERS:
        own = [event for event in events if event[1] == layer]
        for (time, _, name), (until, _, _) in itertools.pairwise([*own, (end, layer, "")]):
            if name in STATE_COLOURS:
                data.append(_state(time, until, height[layer], name))
    data.append(_events(events, height, end))
    speed = frames.ego["speed_mps"].to_numpy(np.float64) * MPS_TO_KMH
    data.append(
        {
            "type": "scatter",
            "mode": "lines",
            "x": _rounded(frames.time_s, 3),
            "y": _rounded(speed, 2),
            "line": {"color": WINE, "width": 2},
            "hovertemplate": "%{x:.2f} s: %{y:.1f} km/h<extra></extra>",
            **_BELOW,
        }
    )
    data += _marks(frames, run)
    layout = _layout(330) | {
        "annotations": _arrows(events, height),
        "xaxis": _axis(range=[-0.02 * end, 1.02 * end], matches="x2", showticklabels=False, anchor="y"),
        "xaxis2": _axis("Time (s)", anchor="y2"),
        "yaxis": _axis(
            domain=[0.48, 1.0],
            range=[-0.7, len(LAYERS) - 0.3],
            tickvals=list(height.values()),
            ticktext=[layer.capitalize() for layer in height],
        ),
        "yaxis2": _axis(
            "Ego speed (km/h)", domain=[0.0, 0.43], range=[0, 1.2 * max(float(speed.max()), 1.0)], anchor="x2"
        ),
    }
    return {"data": data, "layout": layout}


def _state(time_s: float, until_s: float, height: int, name: str) -> dict[str, Any]:
    """A layer's line while a state lasts."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": _rounded([time_s, until_s], 3),
        "y": [height, height],
        "line": {"color": STATE_COLOURS[name], "width": 6},
        "hovertemplate": f"{event_text(name)}<br>%{{x:.2f}} s<extra></extra>",
    }


def _events(events: Sequence[Event], height: dict[str, int], end_s: float) -> dict[str, Any]:
    """Markers with names: the first of a layer towards the middle, others to the right if there is room."""
    named: set[str] = set()
    places = []
    for time, layer, _ in events:
        if layer in named:
            places.append("top right" if time < 0.9 * end_s else "bottom left")
        else:
            places.append("top left" if time > 0.5 * end_s else "top right")
        named.add(layer)
    return {
        "type": "scatter",
        "name": "events",
        "mode": "markers+text",
        "x": _rounded([time for time, _, _ in events], 3),
        "y": [height[layer] for _, layer, _ in events],
        "text": [html.escape(event_text(name)) for _, _, name in events],  # plotly reads some HTML
        "textposition": places,
        "textfont": {"size": 11},
        "marker": {
            "size": 10,
            "symbol": ["x" if layer == "monitors" else "square" for _, layer, _ in events],
            "color": [
                BLUE if layer == "monitors" else STATE_COLOURS.get(name, GREY) for _, layer, name in events
            ],
            "line": {"color": "white", "width": 1},
        },
        "hovertemplate": "%{text}<br>%{x:.2f} s<extra></extra>",
        "cliponaxis": False,
    }


def _arrows(events: Sequence[Event], height: dict[str, int]) -> list[dict[str, Any]]:
    """From each cause down to its effect."""
    arrows = []
    for time, layer, name in events:
        cause = latest_cause(events, name, time)
        if cause is not None and height[cause[1]] > height[layer]:
            ends = {"ax": round(cause[0], 3), "ay": height[cause[1]], "x": round(time, 3), "y": height[layer]}
            arrows.append(_ARROW | ends)
    return arrows


def _marks(frames: LogFrames, run: Run) -> list[dict[str, Any]]:
    """Brake request, stop and contact on the speed."""
    end = "contact" if run["collided"] else "stop"
    marks = [
        (run["flag_time_s"], "brake requested", "x-thin", BLACK, "top left"),
        (run["contact_time_s"], "contact", "circle-open", VERMILLION, "bottom left"),
        (run["t0_s"], "stop", "square-open", BLACK, "middle left"),
    ]
    speed = frames.ego["speed_mps"].to_numpy(np.float64) * MPS_TO_KMH
    return [
        {
            "type": "scatter",
            "mode": "markers+text",
            "x": [round(float(time), 3)],
            "y": [round(float(np.interp(time, frames.time_s, speed)), 2)],
            "text": [name],
            "textposition": place if time > 0.5 * frames.time_s[-1] else "top right",
            "textfont": {"size": 11},
            "marker": {"symbol": symbol, "size": 10, "color": colour, "line": {"width": 2, "color": colour}},
            "hovertemplate": f"{name}<br>%{{x:.2f}} s, %{{y:.1f}} km/h<extra></extra>",
            "cliponaxis": False,
            **_BELOW,
        }
        for time, name, symbol, colour, place in marks
        if name in ("brake requested", end) and not math.isnan(time)
    ]


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
    drawn = runs[runs["t0_s"].notna() & runs["log"].isin(list(logs))]
    if drawn.empty:
        return []
    flags = (drawn["flag_time_s"] - drawn["t0_s"]).dropna()
    earliest = min(_EARLIEST_S, float(flags.min()) - 0.3) if len(flags) else _EARLIEST_S
    top = 10.0 * math.ceil((float(runs["v_test_kmh"].max()) + 2.0) / 10.0)
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


def _speed_curve(
    run: dict[Any, Any], log: pd.DataFrame, earliest_s: float, name: str
) -> list[dict[str, Any]]:
    """Curve of one run under a name, with its brake request and its contact."""
    colour, style = speed_style(float(run["v_test_kmh"]))
    time, speed = speed_before_t0(run, log)
    first = max(int(np.searchsorted(time, earliest_s)) - 1, 0)
    curve = {"type": "scatter", "meta": str(run["log"])}
    marks = []
    if not math.isnan(run["flag_time_s"]):
        at = float(run["flag_time_s"] - run["t0_s"])
        marks.append((at, float(np.interp(at, time, speed)), "x-thin", "brake requested"))
    if run["collided"]:
        marks.append((0.0, float(speed[-1]), "circle-open", "contact"))
    return [
        curve
        | {
            "mode": "lines",
            "x": _rounded(time[first:], 3),
            "y": _rounded(speed[first:], 2),
            "line": {"color": colour, "dash": _DASHES[style], "width": 2},
            "hovertemplate": f"{name}: %{{y:.1f}} km/h at %{{x:.2f}} s<extra></extra>",
        },
        *(
            curve
            | {
                "mode": "markers",
                "x": [round(x, 3)],
                "y": [round(y, 2)],
                "marker": {
                    "symbol": symbol,
                    "size": 9,
                    "color": colour,
                    "line": {"width": 2.5, "color": colour},
                },
                "hovertemplate": f"{name}: {what}, %{{y:.1f}} km/h at %{{x:.2f}} s<extra></extra>",
                "cliponaxis": False,
            }
            for x, y, symbol, what in marks
        ),
    ]


def _layout(height_px: int) -> dict[str, Any]:
    return {
        "height": height_px,
        "showlegend": False,
        "margin": {"l": 70, "r": 14, "t": 10, "b": 44},
        "font": {"family": _FONT, "size": 12, "color": "#222222"},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "hovermode": "closest",
    }


def _axis(title: str | None = None, **more: Any) -> dict[str, Any]:
    axis = {"gridcolor": "#e6e6e6", "zeroline": False, "linecolor": "#999999", "automargin": True}
    return axis | ({} if title is None else {"title": {"text": title}}) | more


def _rounded(values: Any, digits: int) -> list[float]:
    rounded: list[float] = np.round(np.asarray(values, dtype=np.float64), digits).tolist()
    return rounded
