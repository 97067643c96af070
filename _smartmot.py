"""The start of the command, and the check that the packages Python finds are those of this distribution.

Their names are common. A folder or file of a user's with one of them comes first where its own folder does:
beside a script, or in PYTHONPATH. Nothing is imported before the check but what Python has loaded by itself.
"""

from __future__ import annotations

import os
import sys

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
        found = (finder.find_spec(name, None) for finder in list(sys.meta_path) if finder is not _named)
        spec = next((spec for spec in found if spec is not None), None)
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
        told = foreign(name)
        if told is not None:
            raise ImportError(f"{importing} cannot be imported: {told}", name=name)


class _Named:
    """Finds nothing; says why a module of ours is not found, which is asked after all others have failed."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        """None.

        Raises:
            ImportError: Its package is somebody else's.
        """
        package, _, rest = name.partition(".")
        if rest and package in PACKAGES:
            file = os.path.join(_HOME, *name.split("."))  # noqa: PTH118
            ours = os.path.isfile(f"{file}.py") or os.path.isdir(file)  # noqa: PTH112, PTH113
            told = foreign(package) if ours else None
            if told is not None:
                raise ImportError(f"{name} cannot be imported: {told}", name=name)


_named = _Named()
sys.meta_path.append(_named)


def main() -> None:
    """Entry point: the command; or one line and status 2 where a package of ours is not the one found."""
    for name in PACKAGES:
        told = foreign(name)
        if told is not None:
            print(f"smartmot-eval: {told}", file=sys.stderr)  # noqa: T201 - nothing else is loaded yet
            sys.exit(2)
    from evaluation.cli import main as command

    command()
