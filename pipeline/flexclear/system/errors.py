"""The errors that flexclear raises for expected failures. Each class fixes the exit code of the command."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

Result = TypeVar("Result")
#: largest size of each piece of an error message, and of all errors of a file together [bytes]
LONGEST_SHOWN, LONGEST_MESSAGE = 1000, 3500
#: key that refusals name for a run's limit of evaluations, and what they name in trial runs, whose limits are lower
EVALUATIONS, OF_TRIAL = "([solver.evaluations])", "(a trial run's own limit, not the scene's [solver.evaluations])"
#: exit code of a command that Ctrl-C ended
INTERRUPTED = 130


def terminal_text(text: str, longest: int = LONGEST_SHOWN) -> str:
    """Return text fit for a terminal: control characters are spelt out, the middle of a long text is left out."""
    if len(text) > longest:  # first, since the following line examines each character
        text = _shorten(text, longest)
    text = "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)
    return _shorten(text, longest) if len(text.encode(errors="replace")) > longest else text


def of_trial(refused: str) -> str:
    """Return why a trial run was refused, as its user reads it."""
    return refused.replace(EVALUATIONS, OF_TRIAL)


def _shorten(text: str, longest: int) -> str:
    whole, half = text.encode(errors="replace"), longest // 2
    ends = (part.decode(errors="ignore") for part in (whole[:half], whole[-half:]))
    return f" ... ({len(whole) - 2 * half} bytes left out) ... ".join(ends)


class FlexclearError(Exception):
    """Base of all expected failures; the command returns `exit_code`."""

    exit_code = 1

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to restore the error without `__init__`, whose arguments are not stored."""
        return _of_kind_and_text, (type(self), self.args), self.__dict__


def _of_kind_and_text(kind: type[FlexclearError], args: tuple[str, ...]) -> FlexclearError:
    return kind.__new__(kind, *args)


class InputError(FlexclearError):
    """The user's input is wrong: the error names location, value, rule and remedy.

    place: file and key, e.g. ``scenes/a.toml [joint.A1.clearance]``. problem: what is wrong, with the offending value
    and the rule it breaks. remedy: what to write instead; optional.
    """

    exit_code = 2

    def __init__(self, place: str, problem: str, remedy: str | None = None) -> None:
        self.place, self.problem = terminal_text(place), terminal_text(problem)
        self.remedy = None if remedy is None else terminal_text(remedy)
        text = f"{self.place}: {self.problem}"
        super().__init__(text if remedy is None else f"{text}\n  hint: {self.remedy}")


class InputErrors(InputError):  # noqa: N818 - a plural
    """Several input errors, reported together."""

    def __init__(self, errors: list[InputError]) -> None:
        self.errors = errors
        lines: list[str] = []
        for error in errors:
            if lines and sum(len(text.encode()) + 1 for text in (*lines, str(error))) > LONGEST_MESSAGE:
                lines.append(f"... and {len(errors) - len(lines)} more")
                break
            lines.append(str(error))
        FlexclearError.__init__(self, "\n".join(lines))


def refuse(errors: Sequence[InputError]) -> None:
    """Raise these errors: one as it is, several together; return where there are none."""
    if errors:
        raise errors[0] if len(errors) == 1 else InputErrors(list(errors))


def all_or_errors(makers: Iterable[Callable[[], Result]]) -> list[Result]:
    """Return what the functions return; raise the input errors of all of them together, each once."""
    results, errors = list[Result](), dict[str, InputError]()
    for make in makers:
        try:
            results.append(make())
        except InputError as error:
            errors |= {str(one): one for one in errors_of(error)}
    refuse(list(errors.values()))
    return results


def errors_from(checks: Iterable[Callable[[], object]]) -> list[InputError]:
    """Return the input errors that the checks raise, each once."""
    try:
        all_or_errors(checks)
    except InputError as error:
        return errors_of(error)
    return []


def errors_of(error: InputError) -> list[InputError]:
    """Return the single errors that an error reports."""
    return error.errors if isinstance(error, InputErrors) else [error]


class SolverError(FlexclearError):
    """The solver refused or gave up: the error names the time, the body or joint, and the reason."""

    exit_code = 3


class ResourceError(FlexclearError):
    """A limit of the machine (disk, memory) or of `[limits]` stopped the work; no partly written file is left."""

    exit_code = 4


class StoppedError(FlexclearError):
    """The work was asked to stop before its end, and left its partial results in good order.

    interrupted: by Ctrl-C, not by a time limit. partial: `LabelledArrays` of a single run up to the stop.
    """

    def __init__(self, why: str, partial: Any = None, *, interrupted: bool = False) -> None:
        super().__init__(why)
        self.partial, self.interrupted = partial, interrupted
        self.exit_code = INTERRUPTED if interrupted else ResourceError.exit_code


def error_of(exit_code: int, place: str, text: str) -> FlexclearError:
    """Return an error of the class with this exit code from a message that is complete already."""
    kind = {one.exit_code: one for one in (InputError, SolverError, ResourceError)}.get(exit_code, FlexclearError)
    error = _of_kind_and_text(kind, (text,))
    if isinstance(error, InputError):
        error.place, error.problem, error.remedy = place, text, None
    return error
