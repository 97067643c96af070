"""The paper's pedestrian test at several speeds with two monitored areas, as a table and a picture.

    python examples/sweep_cpna.py [PICTURE.png]

The command `smartmot-eval cpna` gives the same rows.
"""

import sys

import matplotlib as mpl

import smartmot

mpl.use("Agg")  # no window
import matplotlib.pyplot as plt


def main(picture: str = "sweep_cpna.png") -> None:
    """Run the sweep, print its table and draw the impact speeds."""
    results = smartmot.sweep("cpna", speed_kmh=(30, 40, 50, 60), strategy=("rectangular", "map"))
    print(results)

    runs = results.frame()  # the rows of runs.csv
    impact = runs.pivot_table(index="v_test_kmh", columns="strategy", values="v_impact_kmh")
    figure, axes = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
    axes.plot(impact.index, impact.index, color="grey", linestyle=":", label="unbraked")
    for strategy in impact.columns:
        axes.plot(impact.index, impact[strategy], marker="o", label=strategy)
    axes.set(xlabel="Test speed (km/h)", ylabel="Impact speed (km/h)", ylim=(-2, None))
    axes.legend()
    figure.savefig(picture, dpi=150)
    plt.close(figure)
    print(f"picture: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:2])
