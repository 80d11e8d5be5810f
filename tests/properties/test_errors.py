"""Expected failures go from process to process as they are."""

import pickle

import pytest

from flexclear.system.errors import (
    INTERRUPTED,
    FlexclearError,
    InputError,
    InputErrors,
    SolverError,
    StoppedError,
)

ONE = InputError("a.toml [time.end]", "must be greater than 0", "write 1 s")
ERRORS = [ONE, InputErrors([ONE, ONE]), SolverError("at t = 1 s: it jams"), StoppedError("Ctrl-C", interrupted=True)]


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_is_the_same_after_pickling(error: FlexclearError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert again.exit_code == error.exit_code
    assert again.__dict__.keys() == error.__dict__.keys()


def test_what_an_error_holds_next_to_its_text_is_pickled_too() -> None:
    again = pickle.loads(pickle.dumps(InputErrors([ONE])))
    assert (again.errors[0].place, again.errors[0].remedy) == (ONE.place, ONE.remedy)
    assert pickle.loads(pickle.dumps(ERRORS[-1])).exit_code == INTERRUPTED
