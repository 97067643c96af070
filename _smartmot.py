"""The start of the command, the check that our packages are those that Python finds, old names of modules.

Their names are common. A folder or file of a user's with one of them comes first where its own folder does:
beside a script, or in PYTHONPATH. Nothing is imported before the check but what Python has loaded by itself.

For one version, an import of a module by its old name gives the module of the new name and a warning;
docs/moved.md has the same names for people.
"""

from __future__ import annotations

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:  # nothing is imported yet but what Python has loaded by itself, see _smartmot
    from collections.abc import Callable
    from importlib.machinery import ModuleSpec
    from types import CodeType, ModuleType
    from typing import Any

PACKAGES = ("opendrive", "smartmot", "scenarios", "evaluation")
"""Each imports only those before it."""

_HOME = os.path.dirname(os.path.realpath(__file__))  # noqa: PTH120 - pathlib is not loaded yet


def foreign(name: str) -> str | None:
    """What Python imports under the name of one of our packages.

    Args:
        name: out of PACKAGES.

    Returns:
        A message that names both files if it is somebody else's; None if it is ours or there is none.
    """
    module = sys.modules.get(name)
    spec = module.__spec__ if module is not None else None
    if spec is None:
        specs = (finder.find_spec(name, None) for finder in list(sys.meta_path) if finder is not _named)
        spec = next((spec for spec in specs if spec is not None), None)
    if spec is None:
        return None
    theirs = spec.origin or next(iter(spec.submodule_search_locations or ()), "?")
    ours = os.path.join(_HOME, name, "__init__.py")  # noqa: PTH118
    if os.path.realpath(theirs) == os.path.realpath(ours):
        return None
    return (
        f"{os.path.realpath(theirs)} has the name of smartmot's own package {name} ({ours}) and comes first; "
        "rename it, or take its folder out of PYTHONPATH and start from elsewhere"
    )


def check(importing: str) -> None:
    """The packages that one of ours needs are ours as well.

    Args:
        importing: name of the package that is being imported.

    Raises:
        ImportError: Another file or folder of that name comes first; the message names both.
    """
    for name in PACKAGES[: PACKAGES.index(importing)]:
        message = foreign(name)
        if message is not None:
            raise ImportError(f"{importing} cannot be imported: {message}", name=name)


def missing_extra(purpose: str, extra: str, error: object = None) -> str:
    """What to say where a library that a plain install does not have is needed.

    Args:
        purpose: what needs it, as the beginning of a sentence in the plural.
        extra: of `pyproject.toml`, which has it.
        error: of the import, if there was one.

    Returns:
        `PURPOSE need the extra EXTRA (ERROR); install it with: pip install 'smartmot[EXTRA]'`.
    """
    reason = "" if error is None else f" ({' '.join(str(error).split())})"
    return f"{purpose} need the extra {extra}{reason}; install it with: pip install 'smartmot[{extra}]'"


class _Named:
    """Finds nothing; says why a module of ours is not found, which is asked after all others have failed."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """None.

        Raises:
            ImportError: Its package is somebody else's.
        """
        package, _, inner = name.partition(".")
        if inner and package in PACKAGES:
            file = os.path.join(_HOME, *name.split("."))  # noqa: PTH118
            ours = os.path.isfile(f"{file}.py") or os.path.isdir(file)  # noqa: PTH112, PTH113
            message = foreign(package) if ours else None
            if message is not None:
                raise ImportError(f"{name} cannot be imported: {message}", name=name)


_named = _Named()
sys.meta_path.append(_named)


MOVED = {
    "evaluation.arguments": "evaluation.cli.options evaluation.runs.folder_lock evaluation.runs.workers "
    "scenarios.catalogue.maps",
    "evaluation.cell_table": "evaluation.studies.ncap.cell_table",
    "evaluation.cells": "evaluation.studies.ncap.cells",
    "evaluation.comparison": "evaluation.studies.suite evaluation.results.files",
    "evaluation.configuration": "evaluation.runs.configuration",
    "evaluation.conflict": "evaluation.runs.conflict",
    "evaluation.decoding": "evaluation.runs.decoding",
    "evaluation.exact": "scenarios.reading",
    "evaluation.fingerprint": "evaluation.runs.fingerprint",
    "evaluation.folder_lock": "evaluation.runs.folder_lock",
    "evaluation.mot": "evaluation.studies.mot",
    "evaluation.mot.camera": "scenarios.recorded.camera",
    "evaluation.mot.classes": "scenarios.recorded.classes",
    "evaluation.mot.command": "evaluation.studies.mot.run evaluation.cli.mot",
    "evaluation.mot.dataset": "scenarios.recorded.dataset",
    "evaluation.mot.film": "evaluation.studies.mot.film evaluation.views.film.tracks",
    "evaluation.mot.forecast_quality": "evaluation.studies.mot.forecasts evaluation.metrics.forecast_quality",
    "evaluation.mot.kitti": "scenarios.recorded.kitti",
    "evaluation.mot.kitti_poses": "scenarios.recorded.kitti_poses",
    "evaluation.mot.lanes": "evaluation.studies.mot.lanes",
    "evaluation.mot.map_filter": "evaluation.studies.mot.map_filter",
    "evaluation.mot.metrics": "evaluation.metrics.mot evaluation.metrics.matching",
    "evaluation.mot.nuscenes": "scenarios.recorded.nuscenes",
    "evaluation.mot.run": "evaluation.studies.mot.run evaluation.studies.mot.tables "
    "scenarios.recorded.formats evaluation.studies.mot.notes",
    "evaluation.mot.table": "scenarios.recorded.csv_files",
    "evaluation.mot.textfile": "scenarios.recorded.textfile",
    "evaluation.mot.tracking": "evaluation.studies.mot.tracking",
    "evaluation.ncap": "evaluation.studies.ncap.run",
    "evaluation.ncap_grid": "evaluation.studies.ncap.grid",
    "evaluation.pictures": "evaluation.views.pictures",
    "evaluation.plots": "evaluation.views.plots",
    "evaluation.plots.ground": "evaluation.views.plots.ground",
    "evaluation.plots.labels": "evaluation.views.plots.labels",
    "evaluation.plots.log_rows": "evaluation.views.plots.log_rows",
    "evaluation.plots.objects": "evaluation.views.plots.objects",
    "evaluation.plots.polygons": "evaluation.views.plots.polygons",
    "evaluation.plots.scene": "evaluation.views.plots.birdseye",
    "evaluation.plots.speed": "evaluation.views.plots.speed",
    "evaluation.plots.strategies": "evaluation.views.plots.strategies",
    "evaluation.plots.style": "evaluation.views.plots.style",
    "evaluation.plots.temporal": "evaluation.views.plots.temporal",
    "evaluation.protocols.euroncap_2026_grid": "evaluation.protocols.euroncap_2026.grid",
    "evaluation.protocols.euroncap_2026_requirements": "evaluation.protocols.euroncap_2026.requirements",
    "evaluation.protocols.matrix": "evaluation.views.matrix.matrix",
    "evaluation.protocols.matrix_html": "evaluation.views.matrix.html",
    "evaluation.protocols.matrix_png": "evaluation.views.matrix.png",
    "evaluation.protocols.verification": "evaluation.protocols.euroncap_2026.verification",
    "evaluation.reading": "scenarios.reading",
    "evaluation.reference": "evaluation.studies.reference",
    "evaluation.reference.command": "evaluation.studies.reference.command",
    "evaluation.reference.cpna": "evaluation.studies.reference.cpna",
    "evaluation.reference.cpna_findings": "evaluation.studies.reference.findings.cpna",
    "evaluation.reference.kept": "evaluation.studies.reference.kept",
    "evaluation.reference.mechanisms": "evaluation.studies.reference.mechanisms",
    "evaluation.reference.part": "evaluation.studies.study",
    "evaluation.reference.parts": "evaluation.studies.reference.parts",
    "evaluation.reference.readme": "evaluation.studies.reference.readme",
    "evaluation.reference.scene_findings": "evaluation.studies.reference.findings.scenes"
    " evaluation.studies.reference.findings.crowds",
    "evaluation.reference.scenes": "evaluation.studies.reference.parts",
    "evaluation.reference.seed_findings": "evaluation.studies.reference.findings.seeds",
    "evaluation.reference.words": "evaluation.studies.reference.words",
    "evaluation.report": "evaluation.views.page",
    "evaluation.report.charts": "evaluation.views.page.charts",
    "evaluation.report.codec": "evaluation.views.page.codec",
    "evaluation.report.explain": "evaluation.views.account.explain",
    "evaluation.report.film": "evaluation.views.film.run",
    "evaluation.report.folder": "evaluation.runs.folder",
    "evaluation.report.page": "evaluation.views.page.page",
    "evaluation.report.payload": "evaluation.views.page.payload",
    "evaluation.report.replay": "evaluation.views.film.replay",
    "evaluation.report.scene": "evaluation.views.frames",
    "evaluation.report.summary": "evaluation.views.page.summary",
    "evaluation.runner": "evaluation.runs.cpna evaluation.runs.specs evaluation.studies.map_description"
    " evaluation.studies.suite",
    "evaluation.seal": "evaluation.results.seal",
    "evaluation.settings": "scenarios.settings evaluation.cli.options",
    "evaluation.study": "evaluation.studies.compare",
    "evaluation.study.answer": "evaluation.studies.compare.answer",
    "evaluation.study.command": "evaluation.studies.compare.command evaluation.studies.compare.study",
    "evaluation.study.criticality": "evaluation.metrics.criticality",
    "evaluation.study.differences": "evaluation.studies.compare.differences",
    "evaluation.study.figures": "evaluation.studies.compare.figures",
    "evaluation.study.grid": "evaluation.studies.compare.grid",
    "evaluation.study.growth": "evaluation.studies.growth",
    "evaluation.study.intervals": "evaluation.metrics.intervals",
    "evaluation.study.journal": "evaluation.runs.journal",
    "evaluation.study.labels": "evaluation.views.plots.labels",
    "evaluation.study.measures": "evaluation.studies.compare.measures",
    "evaluation.study.progress": "evaluation.progress",
    "evaluation.study.table": "evaluation.studies.compare.table",
    "evaluation.study.valid_scenes": "evaluation.studies.compare.valid_scenes",
    "evaluation.validity": "evaluation.studies.ncap.validity",
    "evaluation.video": "evaluation.views.film.maker",
    "evaluation.workers": "evaluation.runs.workers",
    "opendrive.border_sampling": "opendrive.roads.borders",
    "opendrive.curves": "opendrive.geometry.curves",
    "opendrive.geometry_reader": "opendrive.xml.columns",
    "opendrive.junction_reader": "opendrive.xml.junctions",
    "opendrive.lane_borders": "opendrive.geometry.borders",
    "opendrive.lane_graph": "opendrive.lanes.graph",
    "opendrive.lane_index": "opendrive.roads.lane_index",
    "opendrive.lane_reader": "opendrive.xml.lanes",
    "opendrive.lateral_shape": "opendrive.geometry.lateral_shape",
    "opendrive.object_reader": "opendrive.xml.objects",
    "opendrive.objects": "opendrive.roads.objects",
    "opendrive.profiles": "opendrive.geometry.profiles",
    "opendrive.reader": "opendrive.xml.reader",
    "opendrive.road_cells": "opendrive.geometry.cells",
    "opendrive.road_geometry": "opendrive.roads.geometry opendrive.roads.road",
    "opendrive.road_reader": "opendrive.xml.roads",
    "opendrive.road_records": "opendrive.roads.road_records",
    "opendrive.travel": "opendrive.lanes.travel",
    "opendrive.values": "opendrive.xml.values",
    "opendrive.writer": "opendrive.xml.writer",
    "opendrive.xml_document": "opendrive.xml.document",
    "scenarios.bystanders": "scenarios.catalogue.bystanders",
    "scenarios.cpna": "scenarios.catalogue.cpna",
    "scenarios.ego_drive": "scenarios.simulation.drive",
    "scenarios.follower": "scenarios.simulation.follower",
    "scenarios.library": "scenarios.catalogue.library",
    "scenarios.map_builder": "scenarios.catalogue.map_builder scenarios.catalogue.maps",
    "scenarios.openscenario.actions": "scenarios.openscenario.running.actions "
    "scenarios.openscenario.running.following scenarios.openscenario.running.synchronize",
    "scenarios.openscenario.actors": "scenarios.openscenario.running.actors",
    "scenarios.openscenario.catalogs": "scenarios.openscenario.reading.catalogs",
    "scenarios.openscenario.conditions": "scenarios.openscenario.running.conditions",
    "scenarios.openscenario.distributions": "scenarios.openscenario.reading.distributions",
    "scenarios.openscenario.document": "scenarios.openscenario.reading.document",
    "scenarios.openscenario.engine": "scenarios.openscenario.running.engine "
    "scenarios.openscenario.running.results",
    "scenarios.openscenario.holding": "scenarios.openscenario.running.holding "
    "scenarios.openscenario.running.relative scenarios.openscenario.running.own "
    "scenarios.openscenario.running.conditions",
    "scenarios.openscenario.initial": "scenarios.openscenario.running.initial",
    "scenarios.openscenario.parameters": "scenarios.openscenario.reading.parameters",
    "scenarios.openscenario.paths": "scenarios.openscenario.motion.paths",
    "scenarios.openscenario.positions": "scenarios.openscenario.motion.positions",
    "scenarios.openscenario.profiles": "scenarios.openscenario.motion.profiles",
    "scenarios.openscenario.read_actions": "scenarios.openscenario.reading.actions",
    "scenarios.openscenario.read_conditions": "scenarios.openscenario.reading.conditions",
    "scenarios.openscenario.read_positions": "scenarios.openscenario.reading.positions "
    "scenarios.openscenario.reading.elements",
    "scenarios.openscenario.reader": "scenarios.openscenario.reading.reader",
    "scenarios.openscenario.roads": "scenarios.openscenario.motion.roads",
    "scenarios.openscenario.storyboard": "scenarios.openscenario.running.storyboard",
    "scenarios.openscenario.synchronize": "scenarios.openscenario.running.synchronize",
    "scenarios.openscenario.trajectories": "scenarios.openscenario.motion.trajectories",
    "scenarios.openscenario.world": "scenarios.openscenario.running.world",
    "scenarios.recording": "scenarios.simulation.log",
    "scenarios.scenes.traffic_scenes": "scenarios.scenes.traffic",
    "smartmot.aeb": "smartmot.decision.aeb",
    "smartmot.area.monitored_area": (
        "smartmot.area.monitored smartmot.decision.braking smartmot.area.lanes smartmot.area.rectangle"
        " smartmot.area.everything"
    ),
    "smartmot.assignment": "smartmot.tracking.assignment",
    "smartmot.association": "smartmot.tracking.association",
    "smartmot.braking": "smartmot.decision.braking",
    "smartmot.channel_filter": "smartmot.filters.channels",
    "smartmot.collision": "smartmot.decision.collision",
    "smartmot.kalman": "smartmot.filters.kalman",
    "smartmot.lifecycle": "smartmot.tracking.lifecycle",
    "smartmot.monitored_area": (
        "smartmot.area.monitored smartmot.decision.braking smartmot.area.lanes smartmot.area.rectangle"
        " smartmot.area.everything"
    ),
    "smartmot.motion_models": "smartmot.filters.motion_models",
    "smartmot.own_tracker": "smartmot.tracking.own",
    "smartmot.regulatory": "smartmot.maps.regulatory",
    "smartmot.route": "smartmot.maps.route smartmot.maps.follow",
    "smartmot.strips": "smartmot.maps.strips smartmot.maps.walks",
    "smartmot.tracker": "smartmot.tracking.tracker",
    "smartmot.tracker_configs": "smartmot.tracking.configs",
    "smartmot.tracker_state": "smartmot.tracking.state",
    "smartmot.turn_filter": "smartmot.filters.turn",
}
"""New name of each module by its old one, or the names of several that share its content.

What was a module and is now a package has `names_of` in it.
"""


def _warn(old: str, new: str) -> None:
    import warnings

    warnings.warn(f"{old} has moved to {new}", DeprecationWarning, stacklevel=3)


class _Alias:
    """Loads a module by its old name: the one of the new name."""

    def __init__(self, old: str, new: str) -> None:
        self.new = new
        self.old_spec: ModuleSpec = type(sys.__spec__)(old, self)  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        import importlib

        first, *more = self.new.split()
        if more:
            module = type(sys)(spec.name)
            module.__getattr__ = names_of(spec.name, first, *more)  # type: ignore[method-assign]
        else:
            module = importlib.import_module(first)
        self.spec = module.__spec__  # the import system is about to replace it
        return module

    def exec_module(self, module: ModuleType) -> None:
        module.__spec__ = self.spec

    def get_code(self, name: str) -> CodeType | None:
        """The code of the new module, for `python -m` with the old name."""
        import importlib.util

        new = self.new.split()[0]
        spec = importlib.util.find_spec(new)
        self.old_spec.origin = spec.origin if spec is not None else None  # its __file__
        loader: Any = spec.loader if spec is not None else None
        code: CodeType | None = loader.get_code(new) if loader is not None else None
        return code


class _Moved:
    """Finds modules by their old names."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        new = MOVED.get(name)
        if new is None:
            return None
        _warn(name, new)
        return _Alias(name, new).old_spec


def names_of(package: str, *modules: str, front: tuple[str, ...] = ()) -> Callable[[str], Any]:
    """`__getattr__` of a package that was a module: its names are in other modules now.

    Args:
        package: the package.
        modules: where its names are.
        front: names that the package gives without a warning, each loaded when it is asked for.
    """

    def lookup(name: str) -> Any:
        import importlib

        if not name.startswith("__"):
            for module in modules:
                content = vars(importlib.import_module(module))
                # a name that has changed since has an alias of its own
                if name in content or ("__getattr__" in content and hasattr(sys.modules[module], name)):
                    if name not in front:
                        _warn(f"{package}.{name}", f"{module}.{name}")
                    return getattr(sys.modules[module], name)
        raise AttributeError(f"module {package!r} has no attribute {name!r}")

    return lookup


def renamed(module: str, names: dict[str, str]) -> Callable[[str], Any]:
    """`__getattr__` of a module some of whose names have changed: full new names by the old ones."""

    def lookup(name: str) -> Any:
        import importlib

        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        new_module, _, new_name = names[name].rpartition(".")
        _warn(f"{module}.{name}", names[name])
        return getattr(importlib.import_module(new_module), new_name)

    return lookup


# before all others: a package under its old name would find its new modules a second time
sys.meta_path.insert(0, _Moved())


def main() -> None:
    """Entry point: the command; or one line and status 2 where a package of ours is not the one found."""
    _require_ours("smartmot-eval")
    from evaluation.cli import main as command

    command()


def ros_main() -> None:
    """Entry point of the live node; see `main`."""
    _require_ours("smartmot-ros")
    from scenarios.live.node.command import main as command

    command()


def _require_ours(command: str) -> None:
    for name in PACKAGES:
        message = foreign(name)
        if message is not None:
            print(f"{command}: {message}", file=sys.stderr)  # noqa: T201 - nothing else is loaded yet
            sys.exit(2)
