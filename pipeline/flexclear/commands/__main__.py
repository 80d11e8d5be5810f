"""The command ``flexclear``.

Exit codes: 0 done; 2 wrong input; 3 the solver gave up; 4 a limit of the machine, of time or of `[limits]`;
130 interrupted.
"""

from __future__ import annotations

import argparse
import gc
import sys
from collections.abc import Collection
from importlib import import_module
from typing import NoReturn

from flexclear.scene.registry import suggestion
from flexclear.system.errors import InputError
from flexclear.system.version import version
from flexclear.workflow.program import exit_code

#: verb -> its help. The module of the same name has `add_arguments(parser)` and `run_command(options)`
COMMANDS = {
    "new": "write a commented scene to start from",
    "show": "draw the start pose with all names, in seconds, without a simulation",
    "check": "report all errors of scenes, recipes and sweeps, without a simulation",
    "run": "simulate scenes, unless their results are up to date",
    "why": "say for each stage whether it is up to date, or why it would run again",
    "sweep": "vary parameters of a scene, with one dataset and a figure of all points",
    "cost": "study error against cost, and the causes of errors",
    "render": "make pictures, films and interactive pages of scenes",
    "compare": "compare scenes with each other or with their ideal mechanisms",
    "plan": "select the effects, modes and tolerance that the requested accuracy needs",
    "effects": "measure how each part changes each quantity, alone and in pairs",
    "sections": "classify a repeated motion as periodic, quasi-periodic or chaotic",
    "wear": "wear the surfaces of loose joints over many cycles",
    "frequencies": "compute an equilibrium and its natural frequencies",
    "export": "write a scene for other programs: FMU, state space, loads on a flexible body",
    "report": "write the page of scenes: answers, film, figures, assumptions, cost",
    "schema": "print a JSON schema of scenes, recipes or sweeps",
    "cite": "list the sources of the methods and data that a scene uses",
    "completion": "print the completion script for bash or zsh",
    "cache": "manage stored results: size, check, explain, prune",
    "doctor": "check the installation by a run with a known answer; write one file that repeats a failure",
}


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code; errors of the user's input are reported without a traceback."""
    own = arguments is None  # True when this process is the command's own

    def work() -> int | None:
        options = build_parser(sys.argv[1:] if arguments is None else arguments).parse_args(arguments)
        if own:  # imported objects stay: they are garbage neither now nor at the end
            gc.freeze()
        code: int | None = options.command(options)
        return code

    return exit_code(work, own=own)


class Parser(argparse.ArgumentParser):
    """Parser that answers a misspelt command or option with the nearest one."""

    options: Collection[str] = ()

    def error(self, message: str) -> NoReturn:
        """Raise InputError with the nearest option for an unknown one; exit code 2 for every error."""
        from difflib import get_close_matches  # here, since correct options do not need it

        unknown = message.removeprefix("unrecognized arguments: ").split()
        if unknown[0].startswith("-") and message.startswith("unrecognized"):
            name, known = unknown[0].partition("=")[0], {option.lstrip("-"): option for option in self.options}
            near = get_close_matches(name.lstrip("-"), known, n=1)  # without the dashes, which all of them share
            hint = f"did you mean '{known[near[0]]}'?" if near else f"known: {', '.join(sorted(self.options))}"
            raise InputError(name, "unknown option", hint)
        super().error(message)


def require_command(name: str) -> None:
    """Raise InputError for a word that is not a command."""
    if name in COMMANDS or name.startswith("-"):
        return
    if name.endswith(".toml"):
        raise InputError(name, "is not a command", f"a command comes first, as in: flexclear check {name}")
    raise InputError(name, "unknown command", suggestion(name, COMMANDS))


def build_parser(arguments: list[str]) -> argparse.ArgumentParser:
    """Return the parser of the command line: one sub-command per verb; only the requested verb's module is imported."""
    if arguments:
        require_command(arguments[0])
    top = Parser(prog="flexclear", description="Flexible multibody mechanisms with joint clearance.")
    top.add_argument("--version", action="version", version=f"flexclear {version()}", help="print the version")
    verbs = top.add_subparsers(title="commands", metavar="COMMAND", required=True)
    asked = [verb for verb in COMMANDS if verb in arguments[:1]]
    for verb in asked or COMMANDS:  # all verbs only where their list is printed
        text = COMMANDS[verb]
        below = verbs.add_parser(verb, help=text, description=f"{text[0].upper()}{text[1:]}.")
        if asked:
            module = import_module(f"flexclear.commands.{verb}")
            module.add_arguments(below)
            below.set_defaults(command=module.run_command)
            top.options = [option for action in below._actions for option in action.option_strings]
    return top


if __name__ == "__main__":
    sys.exit(main())
