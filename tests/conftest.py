"""What tests of all kinds share: reproducible Hypothesis, results kept out of the project."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).parent.parent

# the same examples everywhere and no deadline: a busy machine is no reason to fail
settings.register_profile("ci", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


@pytest.fixture(scope="session")
def root() -> Path:
    """Folder of the project."""
    return ROOT


@pytest.fixture(scope="session", autouse=True)
def _own_results(tmp_path_factory: pytest.TempPathFactory) -> None:
    """No test reads or writes the results of the project itself; compiled kernels are the user's.

    Child processes write their compiled modules: without them each start, of hundreds, parses all sources again.
    """
    os.environ["FLEXCLEAR_RESULTS"] = str(tmp_path_factory.mktemp("results"))
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
