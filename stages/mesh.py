"""Stage 1, mesh: the recipe of each body -> nodes, cells and named frames.

Run this stage alone for a scene, on the files that the stage before has written:

    python stages/mesh.py SCENE        (or: make mesh SCENE=...)
"""

import argparse
import sys

import flexclear as fc


def main() -> None:
    """Run the stage and print which files went in, which came out, and what is in them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    for step in fc.stage(parser.parse_args().scene, "mesh"):
        mesh = step.result
        print(step)
        print(f"  {step.body} can be joined at {', '.join(mesh['frame'].values)}")


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
