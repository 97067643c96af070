"""What more and more others around the ego cost, in sentences from the tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from evaluation.runs.execution import FrameTime
from evaluation.studies.growth import GrowthRun, Timed

OUTGROWN = 2.5
"""Time of twice as many others over that of half; 2 is in proportion, the rest is noise of the machine."""


def told_growth(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> list[str]:
    """What more others cost each strategy."""
    counts = sorted({run.others for run in runs})
    few, most = counts[0], counts[-1]
    half = max((count for count in counts if count <= most / 2), default=few)
    lines = []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        by_count = {
            count: [
                pair
                for pair in zip(runs, spent, strict=True)
                if (pair[0].strategy, pair[0].others) == (strategy, count)
            ]
            for count in (few, half, most)
        }
        alone, middle, crowd = (
            _mean(by_count[n], lambda pair: pair[1].median_ms) or 0.0 for n in (few, half, most)
        )
        tracks = _mean(by_count[most], lambda pair: pair[0].tracks_mean) or 0.0
        text = (
            f"{strategy.capitalize()}: {alone:.2f} ms per frame with {few} others, {middle:.2f} with {half}, "
            f"{crowd:.2f} with {most} ({tracks:.0f} tracks)"
        )
        first, last = (_mean(by_count[n], _flag_s) for n in (few, most))
        if last is None:
            text += f"; no emergency request for the pedestrian with {most} others"
        elif first is not None:
            text += f"; the flag comes {last - first:+.2f} s later".replace("+0.00 s later", "no later")
        false = sum(run.false_activation for run, _ in by_count[most])
        if false:
            text += f"; {false} of {len(by_count[most])} runs with {most} others have a false activation"
        lines.append(f"{text}.")
    return lines


def _flag_s(pair: Timed) -> float | None:
    run, _ = pair
    return None if run.false_activation else run.flag_time_s


def _mean(pairs: Sequence[Timed], value: Callable[[Timed], float | None]) -> float | None:
    """Mean over the runs that have a value; None without any."""
    values = [number for pair in pairs if (number := value(pair)) is not None]
    return sum(values) / len(values) if values else None


def grows_in_proportion(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> bool:
    """Whether the time of no strategy outgrows the number of others from half of them to all, noise apart."""
    most = max(run.others for run in runs)
    times: dict[tuple[str, int], list[float]] = {}
    for run, time in zip(runs, spent, strict=True):
        times.setdefault((run.strategy, run.others), []).append(time.median_ms)
    # the least of the seeds: what else the machine does only adds
    return all(
        min(all_ms) <= OUTGROWN * min(times[strategy, most // 2])
        for (strategy, others), all_ms in times.items()
        if others == most and (strategy, most // 2) in times
    )


def contradictions(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> list[str]:
    """What the paper expects of a crowd and did not come out."""
    if not grows_in_proportion(runs, spent):
        return []
    return ["The paper expects an exponential increase with the number of others; see *Crowds*."]
