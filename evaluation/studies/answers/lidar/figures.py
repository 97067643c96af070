"""Figure of the chains of sensor and detector: what each area avoids, and where it stops for nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evaluation.studies.answers.figures import DPI, WIDTH_IN
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import Results
from evaluation.views.plots.fitting import wrapped
from evaluation.views.plots.style import (
    BLUE,
    FONT_PT,
    GREEN,
    ORANGE,
    SMALL_PT,
    VERMILLION,
    plain_figure,
    set_style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from evaluation.studies.answers.lidar.question import LidarGain

COLOURS = (BLUE, GREEN, VERMILLION, ORANGE)
"""Of the areas, in their order."""
_NAME_IN = 1.35
"""Width that names of chains may take, inches."""


def rates_by_chain(question: LidarGain, results: Results) -> Figure:
    """Collisions avoided and unnecessary stops, a row per chain, a mark per area; the paper's rule."""
    chains, areas = question.chains, question.areas
    figure = plain_figure((WIDTH_IN, 1.0), DPI)
    texts = [wrapped(figure, chain.name, _NAME_IN, SMALL_PT) for chain in chains]
    height_in = 1.5 + 0.5 * len(chains)
    figure.set_figheight(height_in)
    panels = figure.subplots(1, 2, sharey=True)
    figure.subplots_adjust(
        left=0.22, right=0.98, bottom=0.85 / height_in, top=1 - 0.55 / height_in, wspace=0.06
    )
    for axes, measure in zip(panels, DECISIVE, strict=True):
        set_style(axes)
        for k, (area, colour) in enumerate(zip(areas, COLOURS, strict=False)):
            for row, chain in enumerate(chains):
                place = len(chains) - 1 - row + 0.3 - 0.6 * k / max(len(areas) - 1, 1)
                rate = results.estimate(question.arm(chain, area), measure)
                value, low, high = (100 * v for v in (rate.value, rate.low, rate.high))
                axes.plot([low, high], [place, place], color=colour, linewidth=2.0, alpha=0.4)
                label = area.name if row == 0 else None
                axes.plot(
                    value, place, marker="o", markersize=4.0, color=colour, linestyle="none", label=label
                )
        axes.set_title(MEASURES[measure].text, fontsize=FONT_PT, pad=4.0)
        axes.set_xlabel("% of the scenes", fontsize=SMALL_PT)
        axes.set_xlim(-3.0, 103.0)
        axes.set_ylim(-0.6, len(chains) - 0.4)
    panels[0].set_yticks(range(len(chains)), texts[::-1], fontsize=SMALL_PT)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="lower center", ncols=len(areas), fontsize=SMALL_PT, frameon=False,
        bbox_to_anchor=(0.5, 0.18 / height_in),
    )  # fmt: skip
    figure.text(
        0.01, 1 - 0.2 / height_in, f"By sensor and perception, preset {question.preset}", fontsize=FONT_PT
    )
    figure.text(
        0.5, 0.05 / height_in,
        "Bars: 95 % intervals. LiDARs: an upper bound, simulated bodies are simpler than people and cars.",
        ha="center", fontsize=SMALL_PT - 1.0, color="#444444",
    )  # fmt: skip
    return figure
