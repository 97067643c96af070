"""What the map gains when detections come from a LiDAR, in sentences from the kept runs."""

from __future__ import annotations

from evaluation.results.tables import Table
from evaluation.studies.answers.lidar import LearnedGain, LidarGain
from evaluation.studies.answers.lidar.tables import chain_table, findings, pair_findings
from evaluation.studies.answers.results import benefit_difference, decisive_differences
from evaluation.studies.answers.rivals import MAP
from evaluation.studies.answers.tables import points_text
from evaluation.studies.reference.findings.answers import Kept


def told_in_short(kept: Kept[LidarGain]) -> str:
    """What the map gains over the planned path with every chain, in a sentence."""
    question, areas = kept.question, {area.name: area for area in kept.question.areas}
    path, lanes = question.areas[0], areas[MAP.name]
    gains = []
    for chain in question.chains:
        pair = question.arm(chain, lanes), question.arm(chain, path)
        gains.append(f"{chain.name} {points_text(benefit_difference(kept.results, *pair))}")
    differences = decisive_differences(kept.results, question.pairs)
    decided = sum(d.is_decided for d in differences)
    verb = "is" if decided < 2 else "are"
    said = f"{decided or 'None'} of {len(differences)} differences between areas {verb} decided"
    return (
        f"**And with detections from a LiDAR?** {said}. Collisions avoided less unnecessary stops of the map "
        f"against the planned path, in points: {'; '.join(gains)}. For the LiDARs these are upper bounds: "
        "simulated bodies are simpler than people and vehicles."
    )


def sentences(kept: Kept[LidarGain]) -> list[str]:
    """The answer of the study."""
    differences = decisive_differences(kept.results, kept.question.pairs)
    return findings(kept.question, kept.results, differences)


def learned_sentences(kept: Kept[LearnedGain]) -> list[str]:
    """What a network changes against the classical chain."""
    differences = decisive_differences(kept.results, kept.question.pairs)
    return pair_findings(kept.results, kept.question.pairs, differences)


def rates(kept: Kept[LidarGain]) -> Table:
    """A line per chain, area and rule."""
    return chain_table(kept.results, kept.question.groups)
