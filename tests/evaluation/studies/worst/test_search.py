"""The search over drawn scenes: the same scenes as are drawn, its journal, and what it writes."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.special import ndtri

from evaluation.errors import ArgumentError
from evaluation.results.rows import read_runs
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.worst import search as module
from evaluation.studies.worst.family import (
    CUT_OFF_RUN,
    EARLY_RUN,
    NUMBERS,
    Family,
    come,
    least_gap_m,
    why_no_margin,
)
from evaluation.studies.worst.search import Searched, answer, search, write
from scenarios.drawn import draw
from scenarios.drawn.draw import KINDS, copy_maps, grounds_of, scene_of
from scenarios.drawn.values import Given, RejectedDraw
from scenarios.openscenario.running.results import Contact
from scenarios.simulation.ends import EndReason
from scenarios.simulation.log import RunLog
from scenarios.simulation.outcome import Outcome
from scenarios.spec import simulation_of
from smartmot.geometry import signed_gap
from smartmot.types import Dropped

FAMILY = Family("runner from far aside", MAP.arm("physical", "paper"))
OTHER = Family("runner from far aside", PATH.arm("physical", "paper"))


def test_given_numbers_come_in_their_order_and_others_follow_from_them() -> None:
    given = Given([0.25, 0.5])
    first = [given.random() for _ in range(5)]
    assert first[:2] == [0.25, 0.5]
    again, other = Given([0.25, 0.5]), Given([0.25, 0.5000001])
    assert [again.random() for _ in range(5)] == first
    assert [other.random() for _ in range(5)][2:] != first[2:]
    assert all(0.0 <= number < 1.0 for number in first)


def test_a_scene_of_numbers_is_the_scene_that_a_generator_with_these_numbers_draws(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The generator asked in the numbers' place: the file is the same, and so are the values."""
    situation = next(s for s in KINDS["brake"] if s.name == FAMILY.name)
    grounds = grounds_of("test", None)
    copy_maps(tmp_path, grounds)
    drawn = 0
    for seed in range(6):
        numbers = np.random.default_rng(seed).random(NUMBERS).tolist()
        try:
            scene_of("one", situation, numbers, tmp_path, grounds)
        except RejectedDraw:
            continue
        drawn += 1
        with monkeypatch.context() as patched:
            patched.setattr(draw, "Given", lambda numbers, seed=seed: np.random.default_rng(seed))
            scene_of("two", situation, numbers, tmp_path, grounds)
        assert (tmp_path / "one.xosc").read_bytes() == (tmp_path / "two.xosc").read_bytes()
    assert drawn >= 2


def test_a_case_comes_to_what_its_run_comes_to(tmp_path: Path) -> None:
    """Margin and impact speed by a run of their own; the gap by all pairs of outlines at all times."""
    sample = np.random.default_rng(3).standard_normal((6, FAMILY.dimension))
    possible = 0
    for case in FAMILY.cases(sample):
        came, _ = come(case)
        if came.rejected:
            assert came.margin is None
            continue
        possible += 1
        outcome = simulation_of(case.spec(case.draw(tmp_path))).run()
        assert came.collided == (outcome.contact is not None)
        if came.collided:
            assert came.margin == -came.v_impact_kmh < 0.0
            assert came.v_impact_kmh == pytest.approx(3.6 * outcome.impact_speed_mps, abs=1e-12)
        else:
            assert came.margin == came.gap_m == least_gap_m(outcome) >= 0.0
            table = pd.DataFrame(dict(outcome.log.table()))
            ego = table[table.kind == "ego"].drop_duplicates("time_s").set_index("time_s")
            target = table[(table.kind == "actor") & (table.label == "target")].set_index("time_s")
            both = ego.join(target, rsuffix="_other", how="inner")
            gaps = signed_gap(
                both[["x_m", "y_m"]].to_numpy(), both[["length_m", "width_m"]].to_numpy(),
                both["yaw_rad"].to_numpy(), both[["x_m_other", "y_m_other"]].to_numpy(),
                both[["length_m_other", "width_m_other"]].to_numpy(), both["yaw_rad_other"].to_numpy(),
            )  # fmt: skip
            assert came.gap_m == pytest.approx(max(0.0, gaps.min()), abs=1e-12)
    assert possible >= 2


def test_numbers_and_noise_follow_from_a_sample() -> None:
    uniform = np.full((1, FAMILY.dimension), 0.25)
    (case,) = FAMILY.cases(ndtri(uniform))
    np.testing.assert_allclose(case.numbers, 0.25, atol=1e-12)
    assert case.noise == pytest.approx(0.25e9, abs=2)
    (other,) = OTHER.cases(ndtri(uniform))
    assert case.key != other.key
    assert case.name == other.name  # the scene and its noise are the same


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Searched, Path]:
    out = tmp_path_factory.mktemp("worst")
    return search(FAMILY, out, samples=10, seed=4, plain=10, quiet=True), out


def test_a_search_that_was_carried_out_is_not_carried_out_again(
    found: tuple[Searched, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, out = found

    def never(case: object) -> None:
        raise AssertionError(f"{case} was in the journal")

    monkeypatch.setattr(module, "come", never)
    again = search(FAMILY, out, samples=10, seed=4, plain=10, quiet=True)
    assert again.cases == first.cases
    assert again.failure.probability == first.failure.probability
    assert again.plain == first.plain


def test_it_writes_words_numbers_a_figure_and_the_nearest_failures(
    found: tuple[Searched, Path], tmp_path: Path
) -> None:
    searched, _ = found
    write(searched, tmp_path, ("png",))
    runs = pd.read_csv(tmp_path / "runs.csv.gz")
    assert len(runs) == len(searched.cases)
    assert runs.independent.sum() == searched.first
    told = json.loads((tmp_path / "study.json").read_text(encoding="utf-8"))
    assert told["probability"] == searched.failure.probability
    share = 1.0
    for level in pd.read_csv(tmp_path / "levels.csv")["share below"]:
        share *= level
    assert share == pytest.approx(searched.failure.probability, rel=0.02)  # three digits are printed
    contacts = runs[runs.collided]
    if len(contacts):
        shown = read_runs(tmp_path / "nearest")
        assert sorted(shown.v_impact_kmh) == pytest.approx(
            sorted(contacts.drop_duplicates("run").v_impact_kmh)[: len(shown)], abs=1e-6
        )
        assert all((tmp_path / "nearest" / "logs" / f"{name}.parquet").is_file() for name in shown.log)
    assert (tmp_path / "boundary.png").stat().st_size > 5000
    before = {path.name: path.read_bytes() for path in tmp_path.glob("*") if path.is_file()}
    write(searched, tmp_path, ("png",))
    assert {path.name: path.read_bytes() for path in tmp_path.glob("*") if path.is_file()} == before
    assert gzip.decompress(before["runs.csv.gz"]).startswith(b"run,independent,noise,margin")


def test_a_family_that_is_not_known_is_named() -> None:
    with pytest.raises(ArgumentError, match="pedestrian crosses"):
        Family("somebody crosses", MAP.arm("physical", "paper"))


def test_runs_that_were_cut_off_are_counted_in_words(found: tuple[Searched, Path]) -> None:
    searched, _ = found
    assert not any("in no number" in sentence for sentence in answer(searched).sentences)
    case, came = searched.cases[0]
    for reason, words in (
        (CUT_OFF_RUN, "1 runs were cut off"),
        (EARLY_RUN, "1 runs braked before the target"),
    ):
        silent = replace(came, margin=None, rejected=reason)
        more = replace(searched, cases=(*searched.cases, (case, silent)))
        assert any(sentence.startswith(words) for sentence in answer(more).sentences)


@pytest.mark.parametrize(
    ("touches", "end_reason", "is_early", "expected"),
    [
        (False, EndReason.STOPPED, False, ""),
        (False, EndReason.PASSED, None, ""),
        (False, EndReason.STOPPED, True, EARLY_RUN),
        (False, EndReason.TIME_LIMIT, False, CUT_OFF_RUN),
        (True, EndReason.CONTACT, True, ""),
    ],
)
def test_an_ego_that_braked_before_the_target_set_off_has_avoided_nothing(
    touches: bool, end_reason: EndReason, is_early: bool | None, expected: str
) -> None:
    """As in the other questions, by the same function; a contact is one whatever came before."""
    contact = Contact(3.0, "target", 5.0, 0.0, 50.0) if touches else None
    none = dict.fromkeys(
        ("flag_time_s", "flag_distance_m", "flag_ttc_s", "stop_time_s", "stop_gap_m", "target",
         "target_start_time_s", "target_steady_time_s"),
    )  # fmt: skip
    texts = np.zeros(0, dtype=np.str_)
    outcome = Outcome(
        **none, contact=contact, end_reason=end_reason, false_activation=is_early, end_time_s=4.0,
        detections=0, dropped=Dropped(), notes=(), log=RunLog(texts, texts), frame_time_ms=np.zeros(0),
    )  # fmt: skip
    assert why_no_margin(outcome) == expected
    assert outcome.avoided is (not touches and not expected)
