"""What other tools write in their own way, and what they have that nothing needs."""

import pytest

from scenarios.openscenario import CatalogError, Engine, OpenScenarioError, ParameterError, load
from tests.scenarios.openscenario.conftest import (
    CAR,
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    at,
    event,
    maneuver,
    private,
    speed,
    teleport,
)

TRAILER = CAR.replace("</Vehicle>", "{}</Vehicle>")


def changed(path, old, new):
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return path


@pytest.mark.parametrize("word", ["False", "FALSE", "0"])
def test_truth_values_in_any_letters(write, word):
    path = changed(write(act(maneuver(event("e", speed(5))))), 'Entities="false"', f'Entities="{word}"')
    assert len(load(path).stories) == 1


def test_words_in_any_letters(write):
    path = changed(write(act(maneuver(event("e", speed(5, "linear", "time", 2))))), '"linear"', '"Linear"')
    run = Engine(load(path)).run(3.0)
    assert at(run, "Other", 1.0)[3] == pytest.approx(2.5)


@pytest.mark.parametrize("amount", [-2, 2])
def test_a_rate_is_an_amount_whatever_its_sign(play, amount):
    _, run = play(act(maneuver(event("e", speed(6, "linear", "rate", amount)))))
    assert at(run, "Other", 2.0)[3] == pytest.approx(4.0)


def test_a_parameter_declared_twice_with_the_same_value_is_noted(write):
    declared = '<ParameterDeclaration name="p" parameterType="double" value="{}"/>'
    path = write(parameters=declared.format(1) + declared.format(1))
    assert any("declares 'p' a second time" in note for note in load(path).notes)
    with pytest.raises(ParameterError, match="declares 'p' a second time"):
        load(write(parameters=declared.format(1) + declared.format(2)))


def test_names_of_parameters_with_a_dollar(write, tmp_path):
    (tmp_path / "shelf").mkdir()
    parameter = '<ParameterDeclaration name="w" parameterType="double" value="2"/>'
    entry = CAR.replace(
        "<BoundingBox>", f"<ParameterDeclarations>{parameter}</ParameterDeclarations><BoundingBox>"
    )
    (tmp_path / "shelf" / "c.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/><Catalog name="Cars">'
        + entry.replace('width="2"', 'width="$w"')
        + "</Catalog></OpenSCENARIO>"
    )
    reference = (
        '<CatalogReference catalogName="Cars" entryName="car"><ParameterAssignments>'
        '<ParameterAssignment parameterRef="$w" value="1.5"/></ParameterAssignments></CatalogReference>'
    )
    catalogs = '<VehicleCatalog><Directory path="shelf"/></VehicleCatalog>'
    definition = load(write(other=reference, catalogs=catalogs))
    assert definition.entities[1].width_m == 1.5


def test_a_missing_catalog_directory_matters_only_where_it_is_needed(write):
    catalogs = '<VehicleCatalog><Directory path="nowhere"/></VehicleCatalog>'
    assert any(
        "nowhere does not exist; nothing needs it" in note for note in load(write(catalogs=catalogs)).notes
    )
    reference = '<CatalogReference catalogName="Cars" entryName="car"/>'
    with pytest.raises(CatalogError, match=r"no catalog 'Cars'.*nowhere does not exist"):
        load(write(other=reference, catalogs=catalogs))


def test_hitches_without_a_trailer_are_noted(write):
    loose = TRAILER.format('<TrailerHitch dx="-1"/><Trailer><TrailerRef entityRef=""/></Trailer>')
    assert any("<TrailerHitch> of 'Other' is not used" in note for note in load(write(other=loose)).notes)


def test_a_later_version_is_read_as_the_newest_known(write):
    """Its own elements are refused by name, as every unknown one."""
    path = write(minor=4)
    assert any("version 1.4 is read as 1.3" in note for note in load(path).notes)
    path.write_text(path.read_text().replace("<Entities>", "<Novelty/><Entities>"))
    with pytest.raises(OpenScenarioError, match="<Novelty> in <OpenSCENARIO> is not supported"):
        load(path)


@pytest.mark.parametrize(("major", "minor"), [("2", "0"), ("1", ""), ("1", "x"), ("0", "9")])
def test_other_versions_are_refused(write, major, minor):
    path = write()
    text = path.read_text().replace('revMajor="1" revMinor="3"', f'revMajor="{major}" revMinor="{minor}"')
    path.write_text(text)
    with pytest.raises(OpenScenarioError, match=f"gives version '{major}.{minor}'"):
        load(path)


def test_a_minor_version_with_a_sign_behind_it(write):
    definition = load(changed(write(), 'revMinor="3"', 'revMinor="1+"'))
    assert any("version 1.1+ is read as 1.1" in note for note in definition.notes)
    with pytest.raises(OpenScenarioError, match=r"FileHeader gives version '1\.x'"):
        load(changed(write(), 'revMinor="3"', 'revMinor="x"'))


def test_no_limit_of_executions(write):
    event_text = event("e", speed(5), count=1).replace(
        'maximumExecutionCount="1"', 'maximumExecutionCount="-1"'
    )
    definition = load(write(act(maneuver(event_text))))
    assert definition.stories[0].acts[0].groups[0].maneuvers[0].events[0].max_executions > 10**9
    assert any("maximumExecutionCount -1 is taken as no limit" in note for note in definition.notes)
    with pytest.raises(OpenScenarioError, match="expected 1 or more, got -2"):
        load(write(act(maneuver(event_text.replace("-1", "-2")))))


def test_an_act_that_takes_place_once(write):
    path = changed(
        write(act(maneuver(event("e", speed(5))))),
        '<Act name="act">',
        '<Act name="act" maximumExecutionCount="{}">',
    )
    assert any("an Act takes place once" in note for note in load(changed(path, "{}", "1")).notes)
    with pytest.raises(OpenScenarioError, match="maximumExecutionCount is not supported; leave it out"):
        load(changed(path, 'name="act" maximumExecutionCount="1"', 'name="act" maximumExecutionCount="2"'))


@pytest.mark.parametrize("tag", ["RelativeLane", "RelativeRoad", "RelativeObject", "RelativeWorld"])
def test_differences_that_are_left_out_are_none(play, tag):
    place = f'<Position><{tag}Position entityRef="Ego"/></Position>'
    engine, run = play(init=EGO_AT_START + private("Other", teleport(place)))
    assert at(run, "Other", 0.0)[:3] == pytest.approx((10, -1.75, 0))
    assert any(": 0" in note and "gives no" in note for note in engine.notes)


def test_a_catalog_by_its_file(write, tmp_path):
    (tmp_path / "shelf").mkdir()
    for name in ("cars", "more"):
        (tmp_path / "shelf" / f"{name}.xosc").write_text(
            f'<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/><Catalog name="{name}">{CAR}</Catalog>'
            "</OpenSCENARIO>"
        )
    reference = '<CatalogReference catalogName="{}" entryName="car"/>'
    catalogs = '<VehicleCatalog><Directory path="shelf/cars.xosc"/></VehicleCatalog>'
    definition = load(write(other=reference.format("cars"), catalogs=catalogs))
    assert definition.entities[1].width_m == 2.0
    assert [file.name for file in definition.files if "shelf" in str(file)] == ["cars.xosc"]
    with pytest.raises(CatalogError, match="no catalog 'more'; catalogs found: cars"):
        load(write(other=reference.format("more"), catalogs=catalogs))


def environment(weather):
    inner = f'<Environment name="e"><Weather>{weather}</Weather></Environment>'
    return f"<GlobalAction><EnvironmentAction>{inner}</EnvironmentAction></GlobalAction>"


@pytest.mark.parametrize(
    "weather",
    [
        '<Sun azimuth="0" elevation="1"/>',
        '<Precipitation precipitationType="rain"/>',
        '<DomeImage azimuthOffset="0"><DomeFile filepath="sky.png"/></DomeImage>',
    ],
)
def test_weather_without_amounts(play, weather):
    """Since 1.2 neither illuminance nor intensity has to be there."""
    engine, _ = play(init=environment(weather) + EGO_AT_START + OTHER_AHEAD)
    assert engine.world.environment.illuminance_lx is None


def test_sensors_by_name(play):
    names = '<SensorReferenceSet><SensorReference name="radar"/></SensorReferenceSet>'
    hidden = (
        '<PrivateAction><VisibilityAction graphics="true" sensors="false" traffic="true">'
        f"{names}</VisibilityAction></PrivateAction>"
    )
    engine, _ = play(act(maneuver(event("e", hidden))))
    assert engine.entities.seen.tolist() == [True, False]
    assert any("names sensors: it holds for all that the ego has" in note for note in engine.notes)


def test_paths_with_backslashes(write, tmp_path):
    path = changed(write(), 'filepath="two_roads.xodr"', 'filepath="..\\maps\\two.xodr"')
    (tmp_path.parent / "maps").mkdir(exist_ok=True)
    (tmp_path / "two_roads.xodr").replace(tmp_path.parent / "maps" / "two.xodr")
    assert load(path).map_path.name == "two.xodr"
    with pytest.raises(OpenScenarioError, match=r"maps/three\.xodr does not exist"):
        load(changed(path, "two.xodr", "three.xodr"))


def test_a_logic_file_without_a_name_is_none(write, tmp_path):
    here = '<Position><WorldPosition x="{}" y="0"/></Position>'
    init = private("Ego", teleport(here.format(0)), speed(10)) + private("Other", teleport(here.format(60)))
    path = changed(write(init=init), 'filepath="two_roads.xodr"', 'filepath=""')
    assert load(path).map_path is None
    assert at(Engine(load(path)).run(1.0), "Ego", 1.0) == pytest.approx((10, 0, 0, 10))
    assert load(path, road=tmp_path / "two_roads.xodr").map_path == tmp_path / "two_roads.xodr"
