"""Stage 3, bundle: mesh and modes of each flexible body -> all that its motion needs: inertia, stiffness, shapes.

Run this stage alone for a scene, on the files that the stage before has written:

    python stages/bundle.py SCENE        (or: make bundle SCENE=...)
"""

import argparse
import sys

import flexclear as fc


def main() -> None:
    """Run the stage and print which files went in, which came out, and what is in them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    for step in fc.stage(parser.parse_args().scene, "bundle"):
        bundle = step.result
        print(step)
        print(f"  {step.body}: {float(bundle['mass']):.4g} kg in {bundle.sizes['mode']} modes")


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
