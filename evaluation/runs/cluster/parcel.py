"""What travels: a job and its items as bytes, with the files that they name, known by their content.

On a worker every file lies under the root of a mirror, at the path that it has here. The worker's process
stands in the mirror of this process's folder, so that relative paths lead where they lead here; absolute
ones are marked as they are packed, and get the root put in front there.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import re
import sys
import sysconfig
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path, PurePath
from typing import Any

import evaluation
import opendrive
import scenarios
import smartmot
from evaluation.errors import WorkerError
from evaluation.runs.fingerprint import file_digest, map_of_perception, network_versions, scenario_files
from scenarios.catalogue.library import SHIPPED_SCENARIOS
from scenarios.catalogue.maps import SHIPPED_MAPS
from scenarios.spec import RunSpec
from smartmot.errors import PluginError
from smartmot.plugins import is_of_process, plugin, source_digest, source_files

ROOTS = tuple(Path(str(package.__file__)).parent for package in (opendrive, smartmot, scenarios, evaluation))
"""Folders of this distribution's packages, which a worker has as well."""

_PLUGIN = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")
"""`package.module:name`."""

_TEXT, _PATH = "t", "p"
"""How the mark of a text or of a path begins. A mark is one text, since parts of it would be marked, too."""

DISTRIBUTION, PLUGIN = "distribution", "plug-in"
"""Kinds of needs: the version of a distribution, the source of a plug-in."""

Need = tuple[str, str]
"""Kind and name of what a worker must have in the state in which it is here."""


@dataclass(frozen=True, slots=True)
class Parcel:
    """A packed value.

    Args:
        packed: its bytes, for `unpack`.
        files: SHA-256 of what it takes along, by absolute paths as they are reached here.
        needs: what the worker must have, and its state here.
        folders: of modules that travel, to be looked through by imports.
    """

    packed: bytes
    files: dict[str, str]
    needs: dict[Need, str]
    folders: tuple[str, ...]


def pack(value: object) -> Parcel:
    """Pack a value; runs in it bring their scenarios, maps and networks, names of plug-ins their code.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: a scenario cannot be read.
        ScenarioError: a file cannot be read.
        PluginError: a plug-in cannot be loaded.
    """
    buffer = io.BytesIO()
    packer = _Packer(buffer)
    packer.dump(value)
    return Parcel(buffer.getvalue(), packer.files, packer.needs, tuple(packer.folders))


class _Packer(pickle.Pickler):
    """Gathers files on the way, and marks paths."""

    def __init__(self, file: io.BytesIO) -> None:
        super().__init__(file, protocol=5)
        self.files: dict[str, str] = {}
        self.needs: dict[Need, str] = {}
        self.folders: dict[str, None] = {}

    def persistent_id(self, value: Any) -> str | None:
        """Mark what stands for a path; None: packed as usual."""
        if isinstance(value, RunSpec):
            self._add_run(value)
        elif isinstance(value, PurePath):
            if Path(value).is_file():
                self._add(Path(value))
            return f"{_PATH}{value}"
        elif isinstance(value, str):
            if _PLUGIN.fullmatch(value):
                self._add_plugin(value)
            elif value.startswith("/"):
                return f"{_TEXT}{value}"
        return None

    def _add(self, path: Path) -> None:
        self.files[_place(path)] = file_digest(path)

    def _add_run(self, spec: RunSpec) -> None:
        # a shipped file that is reached by its name is there already; by its path it is a file as any other
        is_named = spec.file in SHIPPED_SCENARIOS
        files = [path for path in scenario_files(spec) if not (is_named and _is_shipped(path))]
        if spec.map_name is not None and spec.map_name not in SHIPPED_MAPS:
            files.append(map_of_perception(spec))
        for path in (*files, *spec.networks):
            self._add(path)
        if spec.networks:
            self.needs |= {(DISTRIBUTION, name): text for name, text in network_versions().items()}

    def _add_plugin(self, name: str) -> None:
        module = name.partition(":")[0]
        first = module.partition(".")[0]
        if first in {root.name for root in ROOTS} or first in sys.stdlib_module_names:
            return
        try:
            digest = plugin(name).digest
        except PluginError:
            if first in sys.modules:
                raise
            return  # a text that only looks like one
        if is_of_process(name):
            raise PluginError(
                f"{name}: an object of this Python process, which does not travel; put its class or function "
                "into a module that can be imported"
            )
        self.needs[PLUGIN, name] = digest
        files = source_files(module)
        for file in (*files, *_beside(files, first)):
            self._add(file)
        top = Path(str(getattr(sys.modules[first], "__file__", None) or files[0]))
        is_package = hasattr(sys.modules[first], "__path__")
        self.folders[_place(top.parents[1] if is_package else top.parent)] = None


def _is_shipped(path: Path) -> bool:
    return any(path.resolve().is_relative_to(root) for root in ROOTS)


def _place(path: Path) -> str:
    """Absolute path without `..`; links are left, since the mirror has none."""
    return os.path.normpath(path.absolute())


def _beside(files: Iterable[Path], first: str) -> list[Path]:
    """Files of modules of the user's own that were loaded from the folder of a plug-in."""
    module = sys.modules[first]
    if hasattr(module, "__path__"):
        return []
    folders = {file.parent for file in files}
    installed = [Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib", "platlib")]
    folders = {folder for folder in folders if not any(folder.is_relative_to(place) for place in installed)}
    loaded = [getattr(other, "__file__", None) for other in list(sys.modules.values())]
    return [Path(file) for file in loaded if file and Path(file).parent in folders]


class _Unpacker(pickle.Unpickler):
    """Puts the root of the mirror in front of paths that travelled."""

    def __init__(self, packed: bytes, root: str, files: Iterable[str]) -> None:
        super().__init__(io.BytesIO(packed))
        self._root, self._files = root, tuple(files)

    def persistent_load(self, mark: Any) -> Any:
        """What a mark stands for here."""
        kind, text = mark[0], mark[1:]
        # the name of a network has more behind the path
        if self._root and any(os.path.normpath(text).startswith(file) for file in self._files):
            text = f"{self._root}{text}"
        return Path(text) if kind == _PATH else text


def unpack(packed: bytes, root: str = "", files: Iterable[str] = ()) -> Any:
    """The value of a parcel.

    Args:
        packed: its bytes.
        root: of the mirror; empty: nothing was moved.
        files: absolute paths that travelled.
    """
    return _Unpacker(packed, root, files).load()


def pack_result(value: object, root: str) -> bytes:
    """Pack what comes back: paths in the mirror are told as they are there, without its root."""
    buffer = io.BytesIO()
    _Returner(buffer, root).dump(value)
    return buffer.getvalue()


class _Returner(pickle.Pickler):
    def __init__(self, file: io.BytesIO, root: str) -> None:
        super().__init__(file, protocol=5)
        self._root = root

    def persistent_id(self, value: Any) -> str | None:
        """Mark a text or a path in the mirror."""
        if isinstance(value, str) and self._root in value:
            return f"{_TEXT}{value.replace(self._root, '')}"
        if isinstance(value, PurePath) and self._root in str(value):
            return f"{_PATH}{str(value).replace(self._root, '')}"
        return None


def state(need: Need) -> str:
    """What a worker has of a need; empty: nothing."""
    kind, name = need
    try:
        return metadata.version(name) if kind == DISTRIBUTION else source_digest(name)
    except (metadata.PackageNotFoundError, PluginError):
        return ""


def content(path: str, digest: str) -> bytes:
    """A file that is to travel.

    Raises:
        WorkerError: it cannot be read, or has been changed since.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise WorkerError(f"{path}: cannot be read any more ({error.strerror})") from None
    if hashlib.sha256(data).hexdigest() != digest:
        raise WorkerError(f"{path}: was changed while its runs were handed over; start again")
    return data
