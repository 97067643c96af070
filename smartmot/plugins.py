"""Objects of the user's own, named `package.module:name`: a tracker, a detector, a monitored area."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from smartmot.errors import PluginError, SmartMotError


@dataclass(frozen=True, slots=True)
class Plugin:
    """A class or function of the user's, called to make an object. Made by `plugin`.

    Args:
        name: `package.module:name`.
        digest: of the source, so that results of a changed one are not taken for its.
    """

    name: str
    digest: str

    def __call__(self, *arguments: object) -> Any:
        """What the class or function returns.

        Raises:
            PluginError: It fails.
        """
        try:
            return _found(self.name)(*arguments)
        except SmartMotError:
            raise
        except Exception as error:
            raise failure(self.name, error) from error


def is_plugin(name: str) -> bool:
    """Whether a name is of the form of a plug-in's."""
    return ":" in name


def plugin(name: str) -> Plugin:
    """Load what a user has named; the current folder is searched first, as by `python -m`.

    Args:
        name: `package.module:name` of a class or function.

    Raises:
        PluginError: There is no such module or name, its import fails, or it cannot be called.
    """
    if not callable(_found(name)):
        raise PluginError(f"{name}: is no class or function; name one that makes the object")
    return Plugin(name, _digest(name.partition(":")[0]))


def failure(name: str, error: Exception) -> PluginError:
    """What to say of an error in a user's code: which, and where it happened."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{last.filename}, line {last.lineno}"
    return PluginError(f"{name}: {type(error).__name__}: {_one_line(error)} ({place})")


def _found(name: str) -> Any:
    module_name, _, path = name.partition(":")
    if not path or not all(part.isidentifier() for part in [*module_name.split("."), *path.split(".")]):
        raise PluginError(f"{name!r}: expected package.module:name, such as my_tracker:MyTracker")
    folder = str(Path.cwd())
    if "" not in sys.path and folder not in sys.path:
        sys.path.insert(0, folder)
    try:
        found: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{module_name}.".startswith(f"{error.name}."):
            raise PluginError(
                f"{name}: no module {error.name!r}; it must be installed or lie in the current folder"
            ) from None
        raise failure(name, error) from error
    except Exception as error:  # whatever a user's module does when it is imported
        raise failure(name, error) from error
    for part in path.split("."):
        try:
            found = getattr(found, part)
        except AttributeError:
            raise PluginError(f"{name}: {found.__name__} has no {part!r}") from None
    return found


def _digest(module_name: str) -> str:
    """Hash of the module's source, or of all modules of the package that it belongs to."""
    spec = importlib.util.find_spec(module_name.partition(".")[0])
    assert spec is not None  # it has been imported
    folders = spec.submodule_search_locations
    files = (
        [Path(spec.origin)]
        if folders is None and spec.origin
        else sorted(path for folder in folders or () for path in Path(folder).rglob("*.py"))
    )
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:24]


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or "no message"
