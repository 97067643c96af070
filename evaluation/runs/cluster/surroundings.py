"""What a run's bytes depend on beside what travels with it: code, Python, libraries, arithmetic."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import scipy.linalg

import scenarios
import smartmot
from evaluation.runs.fingerprint import HASHED_BY_RUNS, library_versions, version

SHIPPED = "shipped scenarios, maps and networks"
ARITHMETIC = "results of numpy and scipy"


def surroundings() -> dict[str, str]:
    """Values by name; a worker that has others could give other bytes, and is refused."""
    python = f"{platform.python_implementation()} {'.'.join(platform.python_version_tuple()[:2])}"
    own = {"smartmot": version(), SHIPPED: _shipped_files()}
    return {**own, "Python": python, **library_versions(), ARITHMETIC: _arithmetic()}


def differences(wanted: Mapping[str, str], there: Mapping[str, str]) -> str:
    """What a worker has otherwise, in words; empty if all is the same."""
    parts = []
    for name, value in wanted.items():
        other = there.get(name, "none")
        if other != value and name == ARITHMETIC:
            parts.append("numpy and scipy compute other last digits there (another processor or library)")
        elif other != value and name == SHIPPED:
            parts.append(f"the {SHIPPED} are others there")
        elif other != value:
            parts.append(f"{name} {other.removeprefix(f'{name} ')}, here {value.removeprefix(f'{name} ')}")
    return "; ".join(parts)


@cache
def _shipped_files() -> str:
    """Digest of the files that the version does not tell: they are hashed by the runs that use them."""
    digest = hashlib.sha256()
    for package in (smartmot, scenarios):
        root = Path(str(package.__file__)).parent
        for path in sorted(path for path in root.rglob("*") if path.suffix in HASHED_BY_RUNS):
            digest.update(path.relative_to(root).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


def _arithmetic() -> str:
    """Digest of functions whose last digits depend on the processor, its vector units and the libraries."""
    x = np.linspace(-7.0, 7.0, 1001)
    matrix = np.add.outer(x[:12], x[5:17] ** 2) + 9.0 * np.eye(12)
    values = (
        np.sin(x), np.cos(x), np.tan(x), np.exp(x), np.log(np.abs(x) + 0.1), np.sqrt(np.abs(x)),
        np.arctan2(x, x[::-1]), np.hypot(x, x[::-1]), np.tanh(x), x.sum(), x.std(), matrix @ matrix.T,
        np.linalg.inv(matrix), scipy.linalg.solve(matrix, x[:12]),
    )  # fmt: skip
    return hashlib.sha256(b"".join(np.ascontiguousarray(value).tobytes() for value in values)).hexdigest()[
        :12
    ]
