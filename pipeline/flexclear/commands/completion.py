"""``flexclear completion``: completion of commands, options and scene files for a shell."""

from __future__ import annotations

import argparse

#: code for the shell; zsh takes bash's form
BASH = """_flexclear() {{
    local current=${{COMP_WORDS[COMP_CWORD]}}
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W "{verbs}" -- "$current"))
        return
    fi
    local options=""
    case "${{COMP_WORDS[1]}}" in
{cases}
    esac
    case "$current" in
        -*) COMPREPLY=($(compgen -W "$options" -- "$current")) ;;
        *) COMPREPLY=($(compgen -f -X '!*.toml' -- "$current") $(compgen -d -- "$current")) ;;
    esac
}}
complete -o filenames -F _flexclear flexclear
"""
SHELLS = {"bash": BASH, "zsh": "autoload -U +X bashcompinit && bashcompinit\n" + BASH}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    parser.add_argument(
        "shell", choices=SHELLS, metavar="SHELL", help='bash or zsh; for example: eval "$(flexclear completion bash)"'
    )


def run_command(options: argparse.Namespace) -> None:
    """Print the completion code of a shell."""
    from flexclear.commands.__main__ import COMMANDS, build_parser

    cases = []
    for verb in COMMANDS:
        (verbs,) = (
            action for action in build_parser([verb])._actions if isinstance(action, argparse._SubParsersAction)
        )
        known = [name for action in verbs.choices[verb]._actions for name in action.option_strings]
        cases.append(f'        {verb}) options="{" ".join(known)}" ;;')
    print(SHELLS[options.shell].format(verbs=" ".join(COMMANDS), cases="\n".join(cases)), end="")
