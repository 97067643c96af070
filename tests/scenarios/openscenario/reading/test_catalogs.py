import pytest

from scenarios.openscenario import CatalogError, ContentError, Engine, ParameterError, load
from tests.scenarios.openscenario.conftest import CAR, EGO_AT_START, OTHER_AHEAD

CATALOG = (
    '<OpenSCENARIO><FileHeader revMajor="1" revMinor="1" date="2026-01-01T00:00:00" author="t" '
    'description="c"/>\n'
    '<Catalog name="Things">\n{}\n</Catalog></OpenSCENARIO>'
)
LONG_CAR = (
    CAR.replace('name="car"', 'name="long"')
    .replace("<BoundingBox>", '<ParameterDeclarations>'
    '<ParameterDeclaration name="l" parameterType="double" value="6"/>'
             "</ParameterDeclarations><BoundingBox>")
    .replace('length="4"', 'length="$l"')
)  # fmt: skip
LOCATION = '<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>'


def reference(entry="long", catalog="Things", given=""):
    return f'<CatalogReference catalogName="{catalog}" entryName="{entry}">{given}</CatalogReference>'


def assign(name, value):
    return (
        f'<ParameterAssignments><ParameterAssignment parameterRef="{name}" value="{value}"/>'
        f"</ParameterAssignments>"
    )


@pytest.fixture
def shop(write, tmp_path):
    def make(other, content=LONG_CAR, locations=LOCATION, parameters=""):
        (tmp_path / "catalogs").mkdir(exist_ok=True)
        (tmp_path / "catalogs" / "things.xosc").write_text(CATALOG.format(content), encoding="utf-8")
        return write(other=other, catalogs=locations, parameters=parameters)

    return make


def test_entries_have_parameters_of_their_own(shop):
    assert load(shop(reference())).entities[1].length_m == 6.0
    assert load(shop(reference(given=assign("l", "7.5")))).entities[1].length_m == 7.5
    declared = '<ParameterDeclaration name="size" parameterType="double" value="5"/>'
    path = shop(reference(given=assign("l", "${2*$size}")), parameters=declared)
    assert load(path, {"size": 4}).entities[1].length_m == 8.0


def test_an_entry_sees_of_the_scenario_what_it_does_not_declare_and_that_is_noted(shop):
    """By the standard it sees its own parameters alone; esmini's maneuvers refer to the scenario's."""
    declared = '<ParameterDeclaration name="l" parameterType="double" value="5"/>'
    bare = CAR.replace('length="4"', 'length="${2*$l}"')
    definition = load(shop(reference("car"), bare, parameters=declared), {"l": 3})
    assert definition.entities[1].length_m == 6.0
    assert [note for note in definition.notes if "does not declare 'l': it is that of the scenario" in note]
    assert load(shop(reference(), parameters=declared), {"l": 3}).entities[1].length_m == 6.0  # its own
    with pytest.raises(
        ParameterError, match=r"things\.xosc:3: <Dimensions> length: parameter 'l' is not decl"
    ):
        load(shop(reference("car"), bare))


def test_a_catalog_is_also_found_by_the_name_of_its_file(shop):
    """As esmini finds it; the name of the catalog comes first."""
    definition = load(shop(reference(catalog="things")))
    assert definition.entities[1].length_m == 6.0
    assert [note for note in definition.notes if "takes 'things' for the file of that name" in note]


def test_a_value_of_another_type_is_refused_where_it_is_needed_as_that(shop):
    wide = reference(given=assign("l", "wide"))
    with pytest.raises(ContentError, match="<Dimensions> length: expected a number without unit"):
        load(shop(wide))
    definition = load(shop(wide, LONG_CAR.replace('length="$l"', 'length="7"')))
    assert definition.entities[1].length_m == 7.0
    assert [note for note in definition.notes if "l: 'wide' is given, which is not of type double" in note]


@pytest.mark.parametrize(
    ("other", "error", "text"),
    [
        (
            reference("nothing"),
            CatalogError,
            "no entry 'nothing' in catalog 'Things'; entries there: env, long",
        ),
        (reference(catalog="Cars"), CatalogError, "no catalog 'Cars'; catalogs found: Things"),
        (reference("env"), CatalogError, "'env' is a <Environment>, expected a <Vehicle> or <Pedestrian>"),
        (
            reference(given=assign("width", 1)),
            ParameterError,
            "Things/long: parameter 'width' is not declared",
        ),
    ],
)
def test_refused(shop, other, error, text):
    with pytest.raises(error, match=text):
        load(shop(other, LONG_CAR + '<Environment name="env"/>'))


def test_missing_directory(shop):
    with pytest.raises(
        CatalogError, match=r"small\.xosc:5: <Directory> catalog directory .*shelf does not exist"
    ):
        load(shop(reference(), locations=LOCATION.replace("catalogs", "shelf")))


def test_changed_catalogs_are_read_again(shop):
    first = load(shop(reference("car"), CAR))
    second = load(shop(reference("car"), CAR.replace('length="4"', 'length="4.25"')))
    assert (first.entities[1].length_m, second.entities[1].length_m) == (4.0, 4.25)


def test_environment_and_maneuver_from_catalogs(write, tmp_path):
    (tmp_path / "catalogs").mkdir()
    night = (
        '<Environment name="night"><TimeOfDay animation="false" dateTime="2026-01-01T00:00:00"/><Weather>'
        '<Sun elevation="${pi/6}" azimuth="0" illuminance="0.1"/><Fog visualRange="80"/>'
        '<Precipitation precipitationType="rain" precipitationIntensity="3"/></Weather>'
        '<RoadCondition frictionScaleFactor="0.7"/></Environment>'
    )
    count = (
        '<Maneuver name="count"><ParameterDeclarations>'
        '<ParameterDeclaration name="to" parameterType="double" value="1"/>'
        '</ParameterDeclarations><Event name="e" priority="parallel"><Action name="a"><GlobalAction>'
        '<VariableAction variableRef="n"><SetAction value="${2*$to}"/></VariableAction></GlobalAction>'
        "</Action></Event>"
        "</Maneuver>"
    )
    (tmp_path / "catalogs" / "all.xosc").write_text(CATALOG.format(night + count), encoding="utf-8")
    act = (
        '<Act name="act"><ManeuverGroup name="g" maximumExecutionCount="1">'
        '<Actors selectTriggeringEntities="false"/>'
        f"{reference('count', given=assign('to', 21))}</ManeuverGroup></Act>"
    )
    init = f"<GlobalAction><EnvironmentAction>{reference('night')}</EnvironmentAction></GlobalAction>"
    engine = Engine(load(write(act, init=init + EGO_AT_START + OTHER_AHEAD, catalogs=LOCATION)))
    assert engine.world.variables["n"] == 42.0
    found = engine.world.environment
    assert found is not None
    assert (found.name, found.illuminance_lx, found.visual_range_m) == ("night", 0.1, 80.0)
    assert (found.precipitation, found.precipitation_mm_h, found.friction_scale) == ("rain", 3.0, 0.7)
    assert found.sun_elevation_rad == pytest.approx(0.5235988)


def test_a_definition_names_every_file_that_was_read(shop, tmp_path):
    path = shop(reference())
    (tmp_path / "catalogs" / "another.xosc").write_text(CATALOG.format(CAR), encoding="utf-8")
    assert load(path).files == (
        path,
        tmp_path / "catalogs" / "another.xosc",
        tmp_path / "catalogs" / "things.xosc",
        tmp_path / "two_roads.xodr",
    )
