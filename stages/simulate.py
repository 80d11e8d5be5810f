"""Stage 4, simulate: the scene and its bundles -> the motion, with the error of its energy.

Run this stage alone for a scene, on the files that the stage before has written:

    python stages/simulate.py SCENE        (or: make simulate SCENE=...)
"""

import argparse
import sys

import flexclear as fc


def main() -> None:
    """Run the stage and print which files went in, which came out, and what is in them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    for step in fc.stage(parser.parse_args().scene, "simulate"):
        run = step.result
        print(step)
        print(f"  {run.attrs['method']}: {run.attrs['evaluations']} evaluations in {run.attrs['steps']} steps")
        print(f"  largest error of the energy {float(abs(run['energy_error']).max()):.2g} J")


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
