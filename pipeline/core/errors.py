"""The ways in which flexclear says no. Each class fixes the exit code of the command."""

from __future__ import annotations

#: characters of a value or a message that are shown; the middle of longer ones is left out
LONGEST = 400


def shown(text: str, longest: int = LONGEST) -> str:
    """Text as it may stand on a terminal: control characters spelt out, the middle of what is long left out."""
    if len(text) > longest:
        half = longest // 2
        text = f"{text[:half]} ... ({len(text) - 2 * half} characters left out) ... {text[-half:]}"
    return "".join(c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text)


class FlexclearError(Exception):
    """Base of all expected failures; `exit_code` is what the command returns."""

    exit_code = 1


class InputError(FlexclearError):
    """The user's input is wrong: names place, value, rule and remedy.

    place: file and key, e.g. ``scenes/a.toml [joint.A1.clearance]``.
    problem: what is wrong, with the offending value and the rule it breaks.
    remedy: what to write instead; optional.
    """

    exit_code = 2

    def __init__(self, place: str, problem: str, remedy: str | None = None) -> None:
        self.place, self.problem, self.remedy = place, problem, remedy
        text = f"{place}: {problem}"
        super().__init__(text if remedy is None else f"{text}\n  hint: {remedy}")


class InputErrors(InputError):  # noqa: N818 - several of them
    """Several input errors, reported together."""

    def __init__(self, errors: list[InputError]) -> None:
        self.errors = errors
        FlexclearError.__init__(self, "\n".join(str(error) for error in errors))


class SolverError(FlexclearError):
    """The solver refused or gave up: names the time, the body or joint, and the reason."""

    exit_code = 3


class ResourceError(FlexclearError):
    """A limit of the machine (disk, memory) stopped the run; nothing half-written is left."""

    exit_code = 4
