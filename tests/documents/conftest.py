"""Inputs of the examples, written once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.documents.inputs import write_inputs


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Small inputs under the names that the examples use; tests work in copies."""
    folder = tmp_path_factory.mktemp("inputs")
    write_inputs(folder)
    return folder
