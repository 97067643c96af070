import importlib.util
import os

import pytest

REQUIRED = os.environ.get("SMARTMOT_TRAFFIC") == "required"


@pytest.fixture(scope="session")
def sumo() -> None:
    """SUMO's library; without the extra the test is skipped."""
    if importlib.util.find_spec("libsumo") is None:
        if REQUIRED:
            pytest.fail("SMARTMOT_TRAFFIC=required, and libsumo is not installed")
        pytest.skip("vehicles of SUMO need the extra sumo (no libsumo); .ci/traffic has it")
