"""The command ``flexclear``.

Exit codes: 0 done; 2 wrong input; 3 the solver gave up; 4 a limit of the machine; 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path

from pipeline.core.errors import FlexclearError, InputError

INTERRUPTED = 130
CLOSED_PIPE = 141


def main(arguments: list[str] | None = None) -> int:
    """Run the command and return its exit code; mistakes of the user are told without a traceback."""
    try:
        options = parser().parse_args(arguments)
        return int(options.command(options) or 0)
    except FlexclearError as error:
        print(f"flexclear: {error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("\nflexclear: interrupted; what was finished is kept", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # the reader (`| head`) has gone; keep the interpreter from complaining about it at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return CLOSED_PIPE


def parser() -> argparse.ArgumentParser:
    """The command line: one sub-command per verb."""
    from stages.graph import STAGES

    top = argparse.ArgumentParser(prog="flexclear", description="Flexible multibody mechanisms with joint clearance.")
    verbs = top.add_subparsers(title="commands", metavar="COMMAND", required=True)

    command = _verb(verbs, "run", _run, "bring scenes up to date")
    command.add_argument("scenes", nargs="+", metavar="SCENE", help="a scene file, or a name below scenes/")
    command.add_argument(
        "--to", choices=STAGES, default="post", metavar="STAGE", help=f"last stage: {', '.join(STAGES)}"
    )
    command.add_argument("--out", type=Path, metavar="FILE.nc", help="copy the dataset of the run here (one scene)")

    command = _verb(verbs, "why", _why, "for each stage: fresh, or why it would run again")
    command.add_argument("scenes", nargs="+", metavar="SCENE")
    command.add_argument("--to", choices=STAGES, default="post", metavar="STAGE", help="last stage")

    command = _verb(verbs, "cost", _cost, "what accuracy costs: errors against cost, and where they come from")
    command.add_argument("scenes", nargs="+", metavar="SCENE")
    command.add_argument("--page", type=Path, metavar="FILE.md", help="write what the studies say as a page")
    command.add_argument("--peer", type=Path, metavar="FILE.json", help="runs of another program, drawn beside ours")
    command.add_argument(
        "--integrators", nargs="+", default=(), metavar="NAME", help="compare only these (default: all six)"
    )

    command = _verb(verbs, "render", _render, "pictures, film and interactive page of scenes")
    command.add_argument("scenes", nargs="+", metavar="SCENE")

    command = _verb(verbs, "frequencies", _frequencies, "equilibrium in a pose, and natural frequencies there")
    command.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    command.add_argument("--at", metavar="TIME", help="time whose drive positions are held, e.g. 0.09 or '90 ms'")
    command.add_argument("--moving", action="store_true", help="the drives keep their speed: steady motion")

    _verb(verbs, "report", _report, "all figures and tables of the paper, and results/report/index.html")
    _verb(verbs, "schema", _schema, "JSON schema of scene files")

    command = _verb(verbs, "cite", _cite, "sources of the methods and data that a scene uses")
    command.add_argument("scene", metavar="SCENE")
    return top


def _verb(verbs: argparse._SubParsersAction, name: str, command: object, text: str) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = verbs.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.")
    parser.set_defaults(command=command)
    return parser


def _run(options: argparse.Namespace) -> None:
    from stages import run

    if options.out is not None and len(options.scenes) > 1:
        raise InputError("--out", f"takes one scene, not {len(options.scenes)}", "run the scenes one by one")
    if options.out is not None:
        run.check_target(options.out)
    graphs = run.graphs(options.scenes)
    place = run.workplace()
    outcome = place.bring([task for graph in graphs for task in graph.up_to(options.to)])
    run.check(outcome)
    if options.to == "bundle":
        print("\n\n".join(filter(None, (run.deficits(graph, place, outcome) for graph in graphs))))
    if options.out is not None:
        run.copy_run(graphs[0], place, options.out)
    run.conclude(graphs, place, outcome)


def _why(options: argparse.Namespace) -> None:
    from pipeline.core.workflow.execute import states
    from stages import run

    place = run.workplace()
    for graph in run.graphs(options.scenes):
        print(graph.scene.name)
        for state in states(graph.up_to(options.to), place.store, place.sources):
            lines = list(state.why) or ["fresh"]
            print(f"  {state.task.label:<16} {lines[0]}", *(f"  {'':<16} {line}" for line in lines[1:]), sep="\n")


def _cost(options: argparse.Namespace) -> None:
    from stages import cost, cost_peers, run

    if options.page is not None:
        run.check_target(options.page, "--page")
    peers = {} if options.peer is None else cost_peers.read(options.peer)
    place, studies = run.workplace(), {}
    for graph in run.graphs(options.scenes):
        studies[graph.scene.name] = _, folder = cost.bring(
            graph.scene, place, peers.get(graph.scene.name, ()), options.integrators
        )
        print(*((folder / name).read_text() for name in cost.PRINTED if (folder / name).is_file()), sep="\n")
        print(f"figures and data: {folder}\n")
    if options.page is not None:
        said = f" --peer {options.peer.as_posix()}" if options.peer else ""
        said += f" --integrators {' '.join(options.integrators)}" if options.integrators else ""
        cost.write_page(studies, options.page, said)


def _render(options: argparse.Namespace) -> None:
    from stages import run

    graphs = run.graphs(options.scenes)
    run.check(run.workplace().bring([graph.render for graph in graphs]))


def _frequencies(options: argparse.Namespace) -> None:
    from pipeline.core.units import quantity
    from stages import frequencies, run

    (graph,) = run.graphs([options.scene])
    try:
        time = None if options.at is None else quantity(options.at, "time")
    except ValueError as error:
        raise InputError(f"--at {options.at}", str(error), "give seconds, or a number with a unit of time") from None
    print(frequencies.text(run.linear(graph.scene, time, moving=options.moving)), end="")


def _report(options: argparse.Namespace) -> None:
    from stages import report, run

    print(report.make(run.workplace()))


def _schema(options: argparse.Namespace) -> None:
    from pipeline.core.scene.schema import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))


def _cite(options: argparse.Namespace) -> None:
    from stages import cite, run

    (graph,) = run.graphs([options.scene])
    print(cite.text(graph, run.workplace().sources), end="")


if __name__ == "__main__":
    sys.exit(main())
