"""Which mechanism makes which published number: the paper's test with one condition changed at a time.

    python -m benchmarks.paper_mechanisms

Prints impact speeds in km/h.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from evaluation.protocols.paper import PUBLISHED
from opendrive import load_map
from scenarios.cpna import CpnaTest, build, find_site
from scenarios.map_builder import shipped_map
from scenarios.places import Site
from scenarios.presets import PAPER, Preset
from scenarios.strategies import make_strategy
from smartmot.monitored_area import MapAreaConfig, RectangularConfig

FRAME_S = 1 / PAPER.sensor.rate_hz
PHASES_S = tuple(k * FRAME_S / 5 for k in range(5))
SEEDS = range(5)


def impacts(
    site: Site,
    preset: Preset,
    strategy: str,
    speed_kmh: float,
    *,
    phases_s: Sequence[float] = (0.0,),
    seeds: Sequence[int] = (0,),
) -> list[float]:
    """Impact speeds in km/h over frame phases and noise seeds."""
    found = []
    for phase in phases_s:
        shifted = replace(preset, sensor=replace(preset.sensor, phase_s=phase))
        area = make_strategy(strategy, shifted, site)
        found += [
            3.6 * build(CpnaTest(speed_kmh, seed=seed), site, shifted, area).run().impact_speed_mps
            for seed in seeds
        ]
    return found


def main() -> None:
    """Print one line per condition."""
    site = find_site(load_map(shipped_map("urban_street")), 80.0)
    far = replace(PAPER, rectangular=RectangularConfig())
    blind = replace(PAPER, sensor=replace(PAPER.sensor, range_m=22.2), map_area=MapAreaConfig())
    free = replace(PAPER, map_area=MapAreaConfig())
    conditions = (
        ("as in preset paper", PAPER, "rectangular", (40.0, 50.0, 60.0)),
        ("as in preset paper", PAPER, "map", (60.0, 70.0, 80.0)),
        ("rectangle 12..30 m, the authors' clamps", far, "rectangular", (40.0, 50.0, 60.0, 70.0, 80.0)),
        ("map, 22.2 m limits the sensor, not the count", blind, "map", (60.0, 70.0, 80.0)),
        ("map, no limit on the reach", free, "map", (60.0, 70.0, 80.0)),
    )
    print("impact speed in km/h; over 5 frame phases and 5 seeds: least .. greatest")
    print(f"{'condition':<46}{'strategy':<13}{'v_test':>7}{'phase 0':>9}{'all phases':>17}{'published':>11}")
    for name, preset, strategy, speeds in conditions:
        for speed in speeds:
            base = impacts(site, preset, strategy, speed)[0]
            spread = impacts(site, preset, strategy, speed, phases_s=PHASES_S, seeds=SEEDS)
            published = PUBLISHED[strategy].get(speed)
            shown = f"{published[0]:.2f}" if published else "-"
            print(
                f"{name:<46}{strategy:<13}{speed:>7g}{base:>9.2f}"
                f"{min(spread):>9.2f} ..{max(spread):>6.2f}{shown:>11}"
            )


if __name__ == "__main__":
    main()
