"""Objects of the user's own: tracker, detector, monitored area, brake rule.

They are named `package.module:name`, or given as objects in Python: see `name_for`.
"""

from __future__ import annotations

import copy
import hashlib
import importlib
import importlib.util
import re
import sys
import traceback
import uuid
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


OBJECT = "object"
"""In the place of a module: an object that this process alone has; see `name_for`."""

_OBJECTS: dict[str, _Object] = {}
"""Objects of this process by their names."""


@dataclass(frozen=True, slots=True)
class _Object:
    """An object of this process.

    Args:
        given: What the user gave.
        make: Makes, or gives, what a run uses.
        digest: No other object has it, in whichever process: what it does cannot be known from outside.
    """

    given: object
    make: Callable[..., Any]
    digest: str


def name_for(given: object, method: str) -> str:
    """The name by which runs know an object that a user gives in Python.

    A class or function that others can import has the name that the command line would have,
    `package.module:name`. Anything else, as of a notebook, gets one that this process alone knows:
    `object:NAME`. Nothing that it does is taken for the same later.

    Args:
        given: A class or function, called once for every run; or an object with `method`: the brake rules
            and monitored areas themselves, copies of others, since these remember.
        method: What the object must have, such as `update`.

    Returns:
        What `plugin` takes.

    Raises:
        PluginError: It is neither, or an object that cannot be copied.
    """
    makes = isinstance(given, type) or (callable(given) and not callable(getattr(given, method, None)))
    if makes:
        name = f"{getattr(given, '__module__', None)}:{getattr(given, '__qualname__', None)}"
        if _is_importable(name, given):
            return name
        for known, entry in _OBJECTS.items():
            if entry.given is given:
                return known
        return _register(given, given)  # type: ignore[arg-type]  # it is callable
    parts = given if isinstance(given, (list, tuple)) else (given,)
    if not parts or not all(callable(getattr(part, method, None)) for part in parts):
        raise PluginError(
            f"{given!r} is neither a class or function, nor an object with {method}(); see docs/plugins.md"
        )
    if method in ("at", "decide"):
        return _register(given, lambda *_: given)
    try:
        kept = copy.deepcopy(given)
    except Exception as error:  # whatever a user's object may raise
        raise PluginError(
            f"{type(given).__name__}: cannot be copied for each run ({type(error).__name__}: "
            f"{_one_line(error)}); give its class, or a function that makes it"
        ) from error
    return _register(given, lambda *_: copy.deepcopy(kept))


def is_of_process(name: str) -> bool:
    """Whether a name is that of an object that this process alone has; see `name_for`."""
    return name.partition(":")[0] == OBJECT


def _register(given: object, make: Callable[..., Any]) -> str:
    """A new name of this process for an object."""
    kind = given if isinstance(given, type) or hasattr(given, "__name__") else type(given)
    stem = re.sub(r"\W+", "", str(getattr(kind, "__name__", ""))) or "own"
    name, number = f"{OBJECT}:{stem}", 1
    while name in _OBJECTS:
        number += 1
        name = f"{OBJECT}:{stem}_{number}"
    _OBJECTS[name] = _Object(given, make, uuid.uuid4().hex[:24])
    return name


def _is_importable(name: str, given: object) -> bool:
    """Whether any process would get an object by a name."""
    if name.startswith("__main__:"):
        return False
    try:
        _digest(name.partition(":")[0])
        return _named_object(name) is given
    except PluginError:
        return False


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
    return Plugin(name, _OBJECTS[name].digest if name in _OBJECTS else _digest(name.partition(":")[0]))


def source_digest(name: str) -> str:
    """Hash of what a name would load now, without loading it: see `Plugin`.

    Raises:
        PluginError: There is no such module, or two of that name.
    """
    if name in _OBJECTS:
        return _OBJECTS[name].digest
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
    if name in _OBJECTS:
        return _OBJECTS[name].make
    module_name, path = _parts(name)
    if module_name == OBJECT:
        raise PluginError(
            f"{name}: an object of the Python process that made the run; no other process has it. Put its "
            "class or function into a module that can be imported"
        )
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


def source_files(module_name: str) -> tuple[Path, ...]:
    """The module's source, or all files of the package that it belongs to, models included.

    Raises:
        PluginError: There is no such module.
    """
    first = module_name.partition(".")[0]
    try:
        spec = importlib.util.find_spec(first)  # a package is not imported, only one in a package would be
    except ValueError:  # a module without a spec, such as __main__
        spec = None
    if spec is None:
        raise PluginError(f"no module {first!r}; it must be installed or lie in the current folder")
    folders = spec.submodule_search_locations
    if folders is None:
        return (Path(spec.origin),) if spec.origin and Path(spec.origin).is_file() else ()
    return tuple(
        sorted(
            path
            for folder in folders
            for path in Path(folder).rglob("*")
            if "__pycache__" not in path.parts and path.is_file()
        )
    )


@cache
def _digest(module_name: str) -> str:
    """Hash of the files of a module: see `source_files`."""
    digest = hashlib.sha256()
    for file in source_files(module_name):
        digest.update(file.name.encode() + file.read_bytes())
    return digest.hexdigest()[:24]


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or "no message"
