"""Stage 2, modes: the mesh of each flexible body -> frequencies and shapes.

Run this stage alone for a scene, on the files that the stage before has written:

    python stages/modes.py SCENE        (or: make modes SCENE=...)
"""

import argparse
import sys

import flexclear as fc


def main() -> None:
    """Run the stage and print which files went in, which came out, and what is in them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    for step in fc.stage(parser.parse_args().scene, "modes"):
        modes = step.result
        print(step)
        for kind, frequency in zip(modes["kind"].values, modes["frequency"].values, strict=True):
            print(f"  {frequency:12.2f} Hz  {kind}")


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
