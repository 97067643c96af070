"""Objects of the user's own, named `package.module:name`: tracker, detector, monitored area, brake rule."""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from inspect import signature
from pathlib import Path, PureWindowsPath
from typing import Any, TypeVar

from smartmot.errors import PluginError, SmartMotError

T = TypeVar("T")

_OURS = {Path(__file__).parents[1] / name for name in ("opendrive", "smartmot", "scenarios", "evaluation")}
"""Folders of this distribution's packages."""

_NOT_THEIRS = _OURS | {Path(importlib.__file__).parent}
"""Folders in which no code of the user's lies, although it is imported from there."""


@dataclass(frozen=True, slots=True)
class Plugin:
    """A class or function of the user's, called to make an object. Made by `plugin`.

    Args:
        name: `package.module:name`.
        digest: of the source, so that results of a changed one are not taken for its.
    """

    name: str
    digest: str

    def __call__(self, *arguments: object, **offered: object) -> Any:
        """What the class or function returns.

        Args:
            arguments: What it is called with.
            offered: What it is given besides if it has parameters of these names.

        Raises:
            PluginError: It does not take the arguments, or fails.
        """
        named = _named_object(self.name)
        keywords: dict[str, object] = {}
        try:
            parameters = signature(named)
            keywords = {k: v for k, v in offered.items() if k in parameters.parameters}
            parameters.bind(*arguments, **keywords)
        except TypeError as error:
            given = ", ".join(type(argument).__name__ for argument in arguments)
            raise PluginError(
                f"{self.name}: is called with ({given}), but: {error}; see docs/plugins.md"
            ) from None
        except ValueError:  # written in C, without a signature
            pass
        try:
            return named(*arguments, **keywords)
        except SmartMotError:
            raise
        except (Exception, SystemExit) as error:
            raise failure(self.name, error) from error


def is_plugin(name: str) -> bool:
    """Whether a name is of the form of a plug-in's; a file on a drive of Windows is none."""
    return ":" in name and not PureWindowsPath(name).is_absolute()


def plugin(name: str) -> Plugin:
    """Load what a user has named, installed or in the current folder.

    Args:
        name: `package.module:name` of a class or function.

    Raises:
        PluginError: There is no such module or name, its import fails, it cannot be called, or the current
            folder and Python have different modules of that name.
    """
    if not callable(_named_object(name)):
        raise PluginError(f"{name}: is no class or function; name one that makes the object")
    return Plugin(name, _digest(name.partition(":")[0]))


def source_digest(name: str) -> str:
    """Hash of what a name would load now, without loading it: see `Plugin`.

    Raises:
        PluginError: There is no such module, or two of that name.
    """
    module_name = _parts(name)[0]
    _search_current_folder(name, module_name.partition(".")[0])
    return _digest(module_name)


def require(made: T, method: str, name: str) -> T:
    """What a user's class or function has made, if it has a method.

    Args:
        made: The object.
        method: Name of what it must have.
        name: What made it, for the message.

    Raises:
        PluginError: It has not.
    """
    if not callable(getattr(made, method, None)):
        raise PluginError(f"{name}: made {type(made).__name__}, which has no {method}(); see docs/plugins.md")
    return made


def name_of(kind: str, user_object: object) -> str:
    """What messages call an object of the user's: `tracker my_tracker:Nearest`."""
    return f"{kind} {type(user_object).__module__}:{type(user_object).__qualname__}"


def called(name: str, method: Callable[..., T], *arguments: object) -> T:
    """What a method of the user's returns, its errors named.

    Raises:
        PluginError: It fails.
    """
    try:
        return method(*arguments)
    except SmartMotError as error:
        raise PluginError(f"{name}: {error}") from error
    except (Exception, SystemExit) as error:  # whatever a user's code may raise
        raise failure(name, error) from error


def failure(name: str, error: Exception | SystemExit) -> PluginError:
    """What to say of an error in a user's code: which, and where in that code it happened."""
    if isinstance(error, SyntaxError) and error.filename is not None:
        place = f" ({error.filename}, line {error.lineno})"
        return PluginError(f"{name}: {type(error).__name__}: {error.msg}{place}")
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if not frame.filename.startswith("<") and _NOT_THEIRS.isdisjoint(Path(frame.filename).parents)
    ]
    # the user's line is told rather than that of a library which it calls
    frames = [frame for frame in frames if "site-packages" not in frame.filename] or frames
    place = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    return PluginError(f"{name}: {type(error).__name__}: {_one_line(error)}{place}")


def _named_object(name: str) -> Any:
    module_name, path = _parts(name)
    _search_current_folder(name, module_name.partition(".")[0])
    try:
        named: Any = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{module_name}.".startswith(f"{error.name}."):
            raise PluginError(
                f"{name}: no module {error.name!r}; it must be installed or lie in the current folder"
            ) from None
        raise failure(name, error) from error
    except (Exception, SystemExit) as error:  # whatever a user's module does when it is imported
        raise failure(name, error) from error
    for part in path.split("."):
        try:
            named = getattr(named, part)
        except AttributeError:
            raise PluginError(f"{name}: {named.__name__} has no {part!r}") from None
    return named


def _parts(name: str) -> tuple[str, str]:
    """Module, and path of the object in it."""
    module_name, _, path = name.partition(":")
    if not path or not all(part.isidentifier() for part in [*module_name.split("."), *path.split(".")]):
        raise PluginError(f"{name!r}: expected package.module:name, such as my_tracker:MyTracker")
    return module_name, path


def _search_current_folder(name: str, top: str) -> None:
    """Let modules of the current folder be imported, after all others: none takes the place of another.

    Args:
        name: `package.module:name`, for the message.
        top: its first module.

    Raises:
        PluginError: The folder has a module of that name, and Python another.
    """
    try:
        folder = str(Path.cwd())
    except FileNotFoundError:  # deleted since
        return
    if "" not in sys.path and folder not in sys.path:
        sys.path.append(folder)
    user_spec = PathFinder.find_spec(top, [folder])
    if user_spec is None:
        return
    user_file = _file(user_spec)
    if top in sys.stdlib_module_names:
        raise PluginError(f"{name}: {user_file} has the name of a module of Python; rename it")
    other_specs = [finder.find_spec(top, None) for finder in sys.meta_path if finder is not PathFinder]
    other_specs.append(PathFinder.find_spec(top, [path for path in sys.path if path not in ("", folder)]))
    for other in other_specs:
        if other is not None and _file(other) != user_file:
            raise PluginError(
                f"{name}: {user_file} and {_file(other)} have the same name; rename the first, or start in "
                "another folder to use the second"
            )


def _file(spec: ModuleSpec) -> Path:
    """The file of a module, or the folder of a package without one."""
    folders = spec.submodule_search_locations
    return Path(spec.origin or next(iter(folders or ()), "?")).resolve()


@cache
def _digest(module_name: str) -> str:
    """Hash of the module's source, or of all files of the package that it belongs to, models included."""
    first = module_name.partition(".")[0]
    try:
        spec = importlib.util.find_spec(first)  # a package is not imported, only one in a package would be
    except ValueError:  # a module without a spec, such as __main__
        spec = None
    if spec is None:
        raise PluginError(f"no module {first!r}; it must be installed or lie in the current folder")
    folders = spec.submodule_search_locations
    files = (
        [Path(spec.origin)]
        if folders is None and spec.origin
        else sorted(
            path
            for folder in folders or ()
            for path in Path(folder).rglob("*")
            if "__pycache__" not in path.parts
        )
    )
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:24]


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or "no message"
