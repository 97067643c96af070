"""The key of a kept run holds every module of this package that what is kept depends on.

From the job of each study the definitions that it uses are followed by name, from module to module.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import evaluation
import opendrive
import scenarios
import smartmot
from evaluation.runs.fingerprint import HASHED_BY_RUNS, OF_EVALUATION, VERSIONED

ROOT = Path(evaluation.__file__).parent

BESIDE = {
    "protocols/errors.py": "kinds of errors",
    "results/calls.py": "which call wrote a folder",
    "results/files.py": "kinds of errors, names of files, and how bytes come to disk",
    "studies/reference/cpna.py": "the name of the log's file",
}
"""Modules that jobs use, on which nothing that is kept depends."""

Definition = tuple[str, str]
"""Module, relative to the package, and a name at its top."""


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse((ROOT / module).read_text(encoding="utf-8"))


@cache
def _imports(module: str) -> dict[str, Definition]:
    """Names that a module takes from others of this package, also within functions."""
    return {
        alias.asname or alias.name: ("/".join(node.module.split(".")[1:]) + ".py", alias.name)
        for node in ast.walk(_tree(module))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("evaluation.")
        for alias in node.names
    }


@cache
def _definitions(module: str) -> dict[str, ast.stmt]:
    """What stands at the top of a module, by name."""
    found: dict[str, ast.stmt] = {}
    for node in _tree(module).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found[node.name] = node
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found |= {n.id: node for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
    return found


def _names(node: ast.AST) -> Iterator[str]:
    """Names that are used; those of types alone are not."""
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns"):
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.Name):
                yield part.id
            elif isinstance(part, ast.AST):
                yield from _names(part)


def _follow(module: str, node: ast.AST, found: set[Definition]) -> None:
    for name in _names(node):
        definition = module, name
        while definition[1] in _imports(definition[0]):
            definition = _imports(definition[0])[definition[1]]
        known = _definitions(definition[0]) if (ROOT / definition[0]).is_file() else {}
        if definition[1] in known and definition not in found:
            found.add(definition)
            _follow(definition[0], known[definition[1]], found)


def _jobs() -> dict[str, tuple[str, ast.FunctionDef]]:
    """Module and job of every study, and what it keeps of a result, by the names of class and method."""
    return {
        f"{owner.name}.{job.name}": (path.relative_to(ROOT).as_posix(), job)
        for path in sorted(ROOT.rglob("*.py"))
        for owner in _tree(path.relative_to(ROOT).as_posix()).body
        if isinstance(owner, ast.ClassDef) and owner.name != "Study"
        for job in owner.body
        if isinstance(job, ast.FunctionDef) and job.name in ("job", "kept")
    }


@pytest.mark.parametrize("name", _jobs())
def test_a_change_of_what_is_measured_makes_other_keys(name: str) -> None:
    module, job = _jobs()[name]
    found: set[Definition] = set()
    _follow(module, job, found)
    modules = {used for used, _ in found}
    assert modules - set(BESIDE) <= set(OF_EVALUATION)


def test_the_jobs_are_found_and_no_module_is_listed_in_vain() -> None:
    """Answers are measured by `decide`, which takes from the comparison when a stop is unnecessary."""
    found: set[Definition] = set()
    for module, job in _jobs().values():
        _follow(module, job, found)
    assert len(_jobs()) == 9 + 1
    assert {("studies/answers/measures.py", "decide"), ("runs/execution.py", "frame_time")} <= found
    assert ("studies/compare/measures.py", "is_unnecessary_stop") in found
    assert {module for module, _ in found} == {*OF_EVALUATION, *BESIDE}


def test_every_shipped_file_is_in_the_version_or_hashed_by_the_runs_that_use_it() -> None:
    shipped = {
        path.suffix
        for package in (opendrive, smartmot, scenarios)
        for path in Path(str(package.__file__)).parent.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts and path.name != "py.typed"
    }
    assert shipped == {*VERSIONED, *HASHED_BY_RUNS}
