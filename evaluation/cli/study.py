"""`smartmot-eval study`: questions of an AEB engineer, answered over drawn scenes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import OF_LIDAR, For, refuse_idle
from evaluation.cli.output import SchedulerAddress, parse_gate, parse_workers, replace_results

if TYPE_CHECKING:
    from evaluation.runs.workers import Workers
    from evaluation.studies.answers.study import Question, Sample
    from evaluation.studies.worst.search import Searched
    from scenarios.settings import Settings

QUESTIONS = ("gain", "break-even", "sensor", "trigger", "severity", "tune", "lidar", "worst")


def _but(*left_out: str) -> tuple[str, ...]:
    return tuple(name for name in QUESTIONS if name not in left_out)


EFFECTS = (
    For(("count",), "question", _but("worst")),
    For(("preset",), "question", _but("sensor")),
    For(("rule",), "question", _but("lidar")),
    For(("strategies",), "question", _but("break-even", "lidar")),
    For(("tuned",), "question", ("gain", "break-even", "trigger")),
    For(("against", "vary"), "question", ("gain",)),
    For(("path_from",), "question", ("break-even",)),
    For(("trials",), "question", ("tune",)),
    For(("weights", "followers"), "question", ("severity",)),
    For(OF_LIDAR, "question", _but("sensor", "lidar")),
    For(("logs",), "question", _but("break-even", "severity", "worst")),
    For(("family", "samples", "monte_carlo"), "question", ("worst",)),
)

EXAMPLES = options.examples(
    "`smartmot-eval study gain --preset physical,real --rule paper,rss`",
    "`smartmot-eval study gain --strategies my_area:MyArea --count 100`",
    "`smartmot-eval study gain --strategies adaptive --against adaptive --vary margin_m=0,1,3`",
    "`smartmot-eval study break-even`",
    "`smartmot-eval study sensor`",
    "`smartmot-eval study trigger`",
    "`smartmot-eval study severity --seed 2`",
    "`smartmot-eval study tune --split train` and then",
    "`smartmot-eval study gain --tuned results/study/tune/tuned.json`",
    "`smartmot-eval study lidar --count 40`",
    "`smartmot-eval study worst --family 'pedestrian crosses' --strategies map --preset real`",
    "What is asked, assumed and computed: docs/answers.md. A study that was killed goes on where it was.",
)


def command(
    context: typer.Context,
    question: Annotated[
        str,
        typer.Argument(
            help="gain: of lanes over a planned path; break-even: how wrong localisation and map may be; "
            "sensor: which error costs most; trigger: which brake rule, how sensitive; severity: what false "
            "activations cost; tune: settings on training scenes; lidar: what the map gains with detections "
            "from point clouds; worst: where one just fails, and how probable that is.",
            metavar="QUESTION",
        ),
    ],
    count: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Scenes of each kind. Default: 300; of severity: 50."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Of scenes and sensor noise.")] = 0,
    split: Annotated[
        str | None, typer.Option(help="Maps of the scenes: train or test. Default: test; of tune: train.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Conditions: paper, physical or real; gain takes several, comma-separated. Default: "
            "physical; of gain: physical,real; of severity: real.",
            metavar="NAMES",
        ),
    ] = None,
    rule: Annotated[
        str | None,
        typer.Option(
            help="Brake rule, shipped or package.module:name; gain, trigger, severity and tune take several. "
            "Default: paper; of gain: paper,cascade; of severity: paper,cascade,rss,staged; of trigger: all. "
            "tune takes the first with every "
            "area, the others with the planned path.",
            metavar="NAMES",
        ),
    ] = None,
    strategies: Annotated[
        str,
        typer.Option(
            help="gain and tune: `adaptive` and your own beside the shipped, package.module:name; sensor, "
            "trigger and worst: the one that is run; severity: those that are run.",
            metavar="NAMES",
        ),
    ] = "",
    tuned: Annotated[
        Path | None,
        typer.Option(help="gain, break-even, trigger: settings that `study tune` chose, beside the others."),
    ] = None,
    against: Annotated[
        str,
        typer.Option(
            help="gain: what all others are compared with, such as `adaptive`, in place of the planned path.",
            metavar="NAME",
        ),
    ] = "path",
    vary: Annotated[
        list[str] | None,
        typer.Option(
            help="gain: further rivals, each area that has the parameter with these values, such as "
            "margin_m=0,1,3; may be repeated.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    path_from: Annotated[
        str,
        typer.Option(
            help="break-even: planner: the planned path is exact relative to the ego; map: it is as wrong as "
            "localisation and map, for both sides alike."
        ),
    ] = "planner",
    sensor: options.SensorName = "truth",
    perception: options.PerceptionName = None,
    street: options.StreetName = None,
    street_density: options.StreetDensity = None,
    street_seed: options.StreetSeed = None,
    family: Annotated[
        str,
        typer.Option(help="worst: situation in which the ego must brake (docs/scenes.md).", metavar="NAME"),
    ] = "",
    samples: Annotated[
        int, typer.Option(min=10, max=100_000, help="worst: scenes of each level, a multiple of 5.")
    ] = 200,
    monte_carlo: Annotated[
        int, typer.Option(min=0, max=10_000_000, help="worst: so many independent scenes beside, as a check.")
    ] = 0,
    weights: Annotated[
        str | None,
        typer.Option(
            help="severity: what speed lost, peak deceleration and those behind weigh. Default: 1,1,1.",
            metavar="A,B,C",
        ),
    ] = None,
    followers: Annotated[
        int,
        typer.Option(
            min=0,
            max=20,
            help="severity: so many vehicles of SUMO behind the ego, who react to it (extra sumo; "
            "docs/traffic.md).",
        ),
    ] = 0,
    trials: Annotated[int, typer.Option(min=1, max=1000, help="tune: settings of each strategy.")] = 12,
    maps: Annotated[
        Path | None, typer.Option(help="Folder with further OpenDRIVE maps to draw on.", metavar="DIR")
    ] = None,
    logs: Annotated[
        bool,
        typer.Option(
            "--logs",
            help="Also log 300 runs at most, those that ended badly first, for `report OUT/QUESTION`.",
        ),
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder of all questions.")] = Path("results/study"),
    form: Annotated[
        str, typer.Option("--format", help="Figures as png, svg or pdf; several, comma-separated.")
    ] = "png,svg",
    workers: options.Workers = None,
    scheduler: SchedulerAddress = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Answer a question about lane filters, errors and brake rules over scenes drawn at random."""
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.answers.command import ask
    from evaluation.studies.answers.results import STUDY_MEASURES, sides_of_results
    from evaluation.studies.answers.study import Sample
    from evaluation.studies.worst.search import WORST_MEASURES, side_of_search
    from scenarios.presets import PRESETS
    from scenarios.settings import PARAMETERS

    question = options.parse_name(question, QUESTIONS, "QUESTION")
    refuse_idle(context, EFFECTS)
    measures = WORST_MEASURES if question == "worst" else STUDY_MEASURES
    gate = parse_gate("study", fail_on, junit, lambda: measures)
    if maps is not None and not maps.is_dir():
        raise ArgumentError(f"--maps: {maps} is no folder; give the one with the OpenDRIVE files")
    split = options.parse_name(
        split or ("train" if question == "tune" else "test"), ("train", "test"), "--split"
    )
    count = count or (50 if question == "severity" else 300)
    sample = Sample(split, count, seed, maps.resolve() if maps else None)
    usual = {"gain": "physical,real", "severity": "real"}.get(question, "physical")
    presets = options.parse_names(preset or usual, tuple(PRESETS), "--preset")
    formats = options.parse_names(form, options.PICTURE_FORMATS, "--format")
    path_from = options.parse_name(path_from, PARAMETERS["path_from"].choices, "--path-from")
    rules = _rules(question, rule)
    lidar = options.parse_lidar(sensor, perception, street, street_density, street_seed)
    who = parse_workers(workers, scheduler)
    if question == "worst":
        if scheduler is not None and maps is not None:
            raise ArgumentError("--maps: a folder of maps does not travel with worst; leave --scheduler out")
        searched = _worst(
            context,
            sample,
            family,
            samples,
            monte_carlo,
            presets,
            rules,
            strategies,
            lidar,
            out,
            formats,
            who,
            quiet,
        )
        gate.close(lambda: [side_of_search(searched)])
        return
    if question == "severity":
        asked = _severity(sample, formats, presets, rules, strategies, weights, followers)
    elif question == "gain":
        asked = _gain(sample, formats, presets, rules, strategies, tuned, against, vary or [])
    else:
        asked = _question(question, sample, formats, presets, rules, strategies, tuned, trials, path_from)
    asked = replace(asked, common=lidar)
    with locked(writable_folder(out)):
        replace_results(context, out / asked.name)
        results = ask(asked, out, who, quiet, logs)
    gate.close(lambda: sides_of_results(results))


def _worst(
    context: typer.Context,
    sample: Sample,
    family: str,
    samples: int,
    monte_carlo: int,
    presets: tuple[str, ...],
    rules: tuple[str, ...],
    strategies: str,
    lidar: Settings,
    out: Path,
    formats: tuple[str, ...],
    workers: Workers,
    quiet: bool,
) -> Searched:
    """The search for the case that just fails."""
    from evaluation.errors import ArgumentError
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.answers.rivals import ADAPTIVE, MAP, RIVALS, Rival
    from evaluation.studies.worst.family import FAMILIES, Family
    from evaluation.studies.worst.search import ask, folder_of

    if not family:
        raise ArgumentError(f"--family: worst needs one of {', '.join(FAMILIES)}")
    if len(presets) > 1 or len(rules) > 1:
        raise ArgumentError("worst: takes one --preset and one --rule")
    family = options.parse_name(family, FAMILIES, "--family")
    shipped = {rival.name: rival for rival in (*RIVALS, ADAPTIVE)}
    chosen = options.parse_name(strategies or MAP.name, tuple(shipped), "--strategies", own=True)
    rival = shipped.get(chosen) or Rival(chosen, "of the user's own", chosen)
    arm = rival.arm(presets[0], rules[0])
    arm.having(*lidar).check()
    if arm.plugins:
        arm.try_out()
    searched = Family(family, arm, sample.split, sample.maps, lidar)
    with locked(writable_folder(out)):
        replace_results(context, folder_of(searched, out))
        return ask(
            searched,
            out,
            samples=samples,
            seed=sample.seed,
            plain=monte_carlo,
            formats=formats,
            workers=workers,
            quiet=quiet,
        )


def _rules(question: str, text: str | None) -> tuple[str, ...]:
    from evaluation.studies.answers.severity import RULES
    from evaluation.studies.answers.trigger import FAMILIES
    from scenarios.settings import PARAMETERS

    known = PARAMETERS["rule"].choices
    if text is None:
        usual = {"trigger": FAMILIES, "gain": ("paper", "cascade"), "severity": RULES}
        return usual.get(question, ("paper",))
    return options.parse_names(text, known, "--rule", own=True)


def _severity(
    sample: Sample,
    formats: tuple[str, ...],
    presets: tuple[str, ...],
    rules: tuple[str, ...],
    strategies: str,
    weights: str | None,
    followers: int,
) -> Question:
    """What false activations cost, as it was typed.

    Raises:
        ArgumentError: an option does not go with it.
    """
    from evaluation.errors import ArgumentError
    from evaluation.studies.answers.rivals import ADAPTIVE, RIVALS, Rival
    from evaluation.studies.answers.severity import Severity, Weights
    from scenarios.traffic.session import library

    if len(presets) > 1:
        raise ArgumentError("--preset: severity takes one; give gain several")
    if followers:
        library()  # refuses where it is not installed
    asked = Severity(sample, formats, preset=presets[0], rules=rules, followers=followers)
    if strategies:
        shipped = {rival.name: rival for rival in (*RIVALS, ADAPTIVE) if not rival.is_as_published}
        names = options.parse_names(strategies, tuple(shipped), "--strategies", own=True)
        areas = tuple(shipped.get(name) or Rival(name, "of the user's own", name) for name in names)
        asked = replace(asked, areas=areas)
    return asked if weights is None else replace(asked, weights=Weights.parsed(weights))


def _own(strategies: str) -> tuple[str, ...]:
    """Areas beside the shipped rivals."""
    from evaluation.studies.answers.rivals import ADAPTIVE

    return options.parse_names(strategies, (ADAPTIVE.name,), "--strategies", own=True) if strategies else ()


def _gain(
    sample: Sample,
    formats: tuple[str, ...],
    presets: tuple[str, ...],
    rules: tuple[str, ...],
    strategies: str,
    tuned: Path | None,
    against: str,
    vary: list[str],
) -> Question:
    """What each area gains, as it was typed.

    Raises:
        ArgumentError: an option does not go with it.
    """
    from evaluation.studies.answers.gain import Gain
    from evaluation.studies.answers.tuned import read_tuned

    return Gain(
        sample,
        formats,
        presets=presets,
        rules=rules,
        own=_own(strategies),
        tuned=read_tuned(tuned, sample) if tuned is not None else (),
        against=against,
        varied=tuple(options.parse_vary(vary).items()),
    )


def _question(
    name: str,
    sample: Sample,
    formats: tuple[str, ...],
    presets: tuple[str, ...],
    rules: tuple[str, ...],
    strategies: str,
    tuned: Path | None,
    trials: int,
    path_from: str,
) -> Question:
    """The question as it was typed.

    Raises:
        ArgumentError: an option does not go with it.
    """
    from evaluation.errors import ArgumentError
    from evaluation.studies.answers.break_even import BreakEven
    from evaluation.studies.answers.lidar import LidarGain
    from evaluation.studies.answers.rivals import ADAPTIVE, MAP, PATH, RIVALS, Rival
    from evaluation.studies.answers.sensor import SensorErrors
    from evaluation.studies.answers.trigger import Trigger
    from evaluation.studies.answers.tune import Tuning
    from evaluation.studies.answers.tuned import read_tuned

    if len(presets) > 1:
        raise ArgumentError(f"--preset: {name} takes one; give gain several")
    if len(rules) > 1 and name in ("break-even", "sensor"):
        raise ArgumentError(f"--rule: {name} takes one")
    chosen_settings = read_tuned(tuned, sample) if tuned is not None else ()
    shipped = {rival.name: rival for rival in (*RIVALS, ADAPTIVE)}
    if name == "lidar":
        return LidarGain(sample, formats, preset=presets[0])
    if name in ("sensor", "trigger"):
        default = MAP.name if name == "sensor" else PATH.name
        chosen = options.parse_name(strategies or default, tuple(shipped), "--strategies", own=True)
        rival = shipped.get(chosen) or Rival(chosen, "of the user's own", chosen)
        if name == "sensor":
            return SensorErrors(sample, formats, rival=rival, rule=rules[0])
        return Trigger(sample, formats, rival=rival, preset=presets[0], rules=rules, tuned=chosen_settings)
    if name == "tune":
        own = _own(strategies)
        return Tuning(sample, formats, preset=presets[0], rules=rules, own=own, trials=trials)
    return BreakEven(
        sample, formats, preset=presets[0], rule=rules[0], tuned=chosen_settings, path_from=path_from
    )
