"""``flexclear show``: the start pose of scenes with all names, as a picture and a page; nothing is run or compiled."""

from __future__ import annotations

import argparse
import sys

from flexclear.scene import toml_files
from flexclear.stages import scenes
from flexclear.stages.export import as_json
from flexclear.stages.show import show_start
from flexclear.stages.workplace import open_workplace
from flexclear.system.errors import InputError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments to its parser."""
    scenes.scene_arguments(parser, "json")
    parser.add_argument(
        "--watch",
        action="store_true",
        help="serve the page of one scene on this machine, with all errors of `check`, and draw again what is saved",
    )
    parser.add_argument(
        "--run", action="store_true", help="with --watch: also run what is saved, for its film and watched curves"
    )


def run_command(options: argparse.Namespace) -> int:
    """Write the picture and the page of each scene to the current folder.

    Exit code 2 where a start does not fit; it is shown all the same.
    """
    if options.watch:
        if len(options.scenes) > 1:
            raise InputError("--watch", f"follows one scene, not {len(options.scenes)}", "name one")
        from flexclear.commands.check import examine
        from flexclear.stages import live

        workplace = open_workplace(options) if options.run else None
        live.follow(options.scenes[0], options.set, examine, workplace)
    if options.run:
        raise InputError("--run", "shows a film on the page that follows a file", "add --watch")
    result, made = 0, dict[str, list[str]]()
    for name in options.scenes:
        scene = scenes.load_by_name(name, options.set)
        scenes.examine(scene, options.set)
        files, refused = show_start(scene, quiet=options.quiet or options.json)
        made[scene.name] = [str(file) for file in files]
        if refused is not None:
            print(f"flexclear: {toml_files.with_line_number(refused)}", file=sys.stderr)
            result = refused.exit_code
    if options.json:
        print(as_json(made))
    return result
