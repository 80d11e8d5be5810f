"""What tests of all kinds share: reproducible Hypothesis, results kept out of the project."""

import os
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

ROOT = Path(__file__).parent.parent

# the same examples everywhere and no deadline: a busy machine is no reason to fail
settings.register_profile("ci", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


#: files of few tests that take long
LONG = (
    *("stages/test_workflow.py", "stages/test_sweep_workers.py", "stages/test_gallery.py", "stages/test_plan.py"),
    *("architecture/test_quick_commands.py", "architecture/test_extending.py"),
    *("analytic/test_accuracy.py", "analytic/test_horizon_ensembles.py"),
    *("stages/test_same_bytes.py", "stages/test_page_examples.py"),
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Workers get files in this order (`--no-loadscope-reorder`): what is begun last is short, so none waits."""
    tests = Counter(item.path for item in items)
    first = {ROOT / "tests" / name for name in LONG}
    items.sort(key=lambda item: (item.path not in first, -tests[item.path]))


@pytest.hookimpl(optionalhook=True)
def pytest_handlecrashitem(sched: Any) -> None:
    """Take the files that a worker killed by the system had finished off the list of files to run.

    xdist would hand them out again, and then wait for ever for their results.
    """
    for name in [name for name, tests in sched.workqueue.items() if all(tests.values())]:
        del sched.workqueue[name]


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
