"""What a user sees while something runs."""

import io
import logging
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from flexclear.system.errors import InputError
from flexclear.system.log import LOG, set_level, write_to
from flexclear.workflow import schedule
from flexclear.workflow.progress import Monitor, duration
from flexclear.workflow.task import Task
from tests.processes import printed


class Screen(io.StringIO):
    """A stream that says whether it is a terminal."""

    def __init__(self, *, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        return self.terminal


class Clock:
    """Time that the test moves."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def watched(*, terminal: bool) -> tuple[Monitor, Screen, Clock]:
    screen, clock = Screen(terminal=terminal), Clock()
    monitor = Monitor(screen, clock)
    monitor.start(2)
    return monitor, screen, clock


def test_lines_that_stay_are_sparse():
    monitor, screen, clock = watched(terminal=False)
    name = monitor.begin("sps4/csj", "simulate")
    for percent in range(100):
        clock.now = percent * 0.3
        monitor.update(name, percent / 100, "")
    monitor.finish(name, failed=False)
    lines = screen.getvalue().splitlines()
    assert lines[0] == "flexclear: [0/2] sps4/csj: simulate"
    assert lines[-1] == "flexclear: [1/2] sps4/csj: simulate done after 29.7 s"
    assert len(lines) == 4  # 30 s, one line every 10 s


def test_what_each_run_of_a_search_says_is_said_once():
    monitor, screen, clock = watched(terminal=False)
    name = monitor.begin("watt", "simulate")
    for _ in range(3):
        monitor.update(name, None, "10 free motions")
        monitor.update(name, None, "warning: 3 ways")
        clock.now += 1.0
    lines = screen.getvalue().splitlines()
    assert [line.rpartition("simulate ")[2] for line in lines[1:]] == ["10 free motions", "warning: 3 ways"]


def test_a_mistake_in_a_recipe_is_located_in_it(tmp_path: Path):
    recipe = tmp_path / "rod.toml"
    recipe.write_text('[frames.foot]\non = { region = "strat" }\n', encoding="utf-8")
    error = InputError(f"{recipe} [frames.foot.on.region]", "no region is called 'strat'")
    failure = schedule._failure(Task("mesh", "rod", "", {}, ""), error)
    assert f"{recipe} [frames.foot.on.region], line 2: no region" in failure.message


def test_the_rest_is_estimated_from_the_pace_without_compiling():
    monitor, screen, clock = watched(terminal=False)
    name = monitor.begin("sps4/csj", "simulate")
    monitor.update(name, None, "compiling")
    assert screen.getvalue().splitlines()[-1].endswith("sps4/csj: simulate compiling")
    clock.now = 30.0
    monitor.update(name, 0.0, "")
    for now, fraction in ((33.0, 0.1), (36.0, 0.2)):
        clock.now = now
        monitor.update(name, fraction, "")
        assert "left" not in screen.getvalue()  # one sample or two say little
    clock.now = 42.0
    monitor.update(name, 0.4, "t = 0.045 s")
    assert screen.getvalue().splitlines()[-1].endswith("simulate  40% 18.0 s left t = 0.045 s")


def test_the_rest_is_estimated_by_the_later_pace_where_that_changes():
    monitor, screen, clock = watched(terminal=False)
    name = monitor.begin("sps4/csj", "simulate")
    for k in range(41):  # the first fifth takes 1 s for each hundredth, what follows 10 s
        clock.now = min(k, 20) + 10.0 * max(k - 20, 0)
        monitor.update(name, k / 100, "")
    # 60 hundredths are left; the mean pace so far is 5.5 s, and 20 samples ago counts for 0.8^20 = 1 % of the last
    assert " 40% 9 min " in screen.getvalue().splitlines()[-1]


def test_a_slow_stretch_is_reported_before_it_ends():
    """Less than a sample's share is done in it, and what is left grows with each look."""
    monitor, screen, clock = watched(terminal=True)
    name = monitor.begin("a", "simulate")
    reported = []
    for now, fraction in [*((float(k), k / 50) for k in range(11)), (100.0, 0.201), (1000.0, 0.202)]:
        clock.now = now
        monitor.update(name, fraction, "")
        reported.append(screen.getvalue().split("\r\033[K")[-1])
    assert reported[10].endswith("20% 40.0 s left")
    # ten samples of 1 s and 0.02 fade to sum 0.8^k = 3.57 of one, and the one that goes on counts whole:
    # (3.57 + 90) s for 3.57 0.02 + 0.001, of which 0.799 is left; then (3.57 + 990) s for 3.57 0.02 + 0.002
    assert reported[11].endswith("20% 17 min 12 s left")
    assert reported[12].endswith("20% 180 min 1 s left")


def test_a_single_task_is_not_counted():
    monitor, screen, _ = watched(terminal=False)
    monitor.start(1)
    monitor.begin("a", "sweep")
    assert screen.getvalue() == "flexclear: a: sweep\n"


def test_a_terminal_keeps_one_line_with_everything_that_runs():
    monitor, screen, clock = watched(terminal=True)
    first, second = monitor.begin("a", "simulate"), monitor.begin("b", "mesh rod1")
    clock.now = 1.0
    monitor.update(first, 0.5, "")
    assert "\n" not in screen.getvalue()
    assert screen.getvalue().split("\r\033[K")[-1] == "[0/2] a: simulate  50% | b: mesh rod1"
    monitor.say("something broke")
    assert screen.getvalue().endswith("\r\033[Kflexclear: something broke\n")
    monitor.finish(first, failed=False)
    monitor.finish(second, failed=True)
    monitor.end()
    assert screen.getvalue().endswith("\r\033[K")


@pytest.mark.parametrize(
    "seconds, text", [(4.24, "4.2 s"), (190.0, "3 min 10 s"), (59.97, "1 min 0 s"), (119.8, "2 min 0 s")]
)
def test_durations_read_well(seconds: float, text: str):
    assert duration(seconds) == text


def test_tasks_of_one_label_are_numbered():
    """Two copies of a scene that differ in its mesh have a task 'mesh rod1' each."""
    monitor, _, _ = watched(terminal=False)
    first, second = monitor.begin("a", "mesh rod1"), monitor.begin("a", "mesh rod1")
    assert (first, second) == ("a: mesh rod1", "a: mesh rod1 (2)")
    monitor.finish(first, failed=False)
    monitor.finish(second, failed=False)
    assert monitor.done == 2


@pytest.fixture(autouse=True)
def _usual_log() -> Iterator[None]:
    set_level()
    yield
    set_level()
    write_to(None)


def test_the_loggers_level_sets_how_much_is_reported():
    reported = {}
    for level in (logging.WARNING, logging.INFO, logging.DEBUG):
        LOG.setLevel(level)
        monitor, screen, clock = watched(terminal=True)
        name = monitor.begin("a", "simulate")
        for fraction in (0.1, 0.2):
            clock.now += 1.0
            monitor.update(name, fraction, "")
        monitor.say("a: warning: something")
        reported[level] = screen.getvalue()
    assert reported[logging.WARNING] == "flexclear: a: warning: something\n"
    assert "\r" in reported[logging.INFO]
    assert reported[logging.INFO].endswith("flexclear: a: warning: something\n")
    assert "\r" not in reported[logging.DEBUG]
    assert reported[logging.DEBUG].count("a: simulate") == 3


def test_a_notebook_shows_bars_that_go(monkeypatch: pytest.MonkeyPatch):
    class Cell(io.StringIO):
        """As the stream of a cell is."""

    class Handle:
        """As a displayed output is."""

        def update(self, html: str) -> None:
            shown.append(html)

    def display(html: str, *, display_id: bool) -> Handle:
        assert display_id
        shown.append(html)
        return Handle()

    shown: list[str] = []
    Cell.__module__ = "ipykernel.iostream"
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(HTML=str, display=display))
    screen, clock = Cell(), Clock()
    monitor = Monitor(screen, clock)
    monitor.start(1)
    name = monitor.begin("a < b", "simulate")
    clock.now = 1.0
    monitor.update(name, 0.5, "")
    monitor.say("a: warning: something")
    monitor.finish(name, failed=False)
    monitor.end()
    assert shown[0] == "<div><progress max='1' value='0.500'></progress> a &lt; b: simulate  50%</div>"
    assert shown[-1] == ""
    assert screen.getvalue() == "flexclear: a: warning: something\n"


def test_a_level_that_is_set_before_the_first_import_stays():
    program = (
        "import logging; logging.getLogger('flexclear').setLevel(logging.ERROR); import flexclear.system.log as log; "
        "print(log.LOG.level)"
    )
    assert printed(program).split() == [str(logging.ERROR)]


def test_other_handlers_get_the_records():
    records: list[logging.LogRecord] = []

    class Keeping(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            records.append(record)

    handler = Keeping()
    LOG.addHandler(handler)
    try:
        monitor, _, _ = watched(terminal=False)
        monitor.begin("a", "simulate")
        monitor.say("beware")
    finally:
        LOG.removeHandler(handler)
    assert [(r.levelname, r.getMessage()) for r in records] == [("INFO", "[0/2] a: simulate"), ("WARNING", "beware")]
