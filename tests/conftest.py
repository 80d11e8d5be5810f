"""What tests of all kinds share: reproducible Hypothesis, results kept out of the project."""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).parent.parent

# the same examples everywhere and no deadline: a busy machine is no reason to fail
settings.register_profile("ci", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


#: files that take longest, the longest first: one that is begun last is run on alone
LONGEST = (
    *("stages/test_plan.py", "stages/test_gallery.py", "analytic/test_accuracy.py", "stages/test_page_examples.py"),
    *("properties/test_articulated.py", "properties/test_specialised.py", "properties/test_derivative.py"),
    *("stages/test_benchmark_families.py", "stages/test_workflow.py", "stages/test_sweep_workers.py"),
    *("stages/test_own_scene.py", "stages/test_sweep.py", "stages/test_fingerprint.py", "stages/test_doctor.py"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files are given to workers in this order (`--no-loadscope-reorder`; else by their numbers of tests)."""
    places = {ROOT / "tests" / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))


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
