"""Stage 5, post: the run -> series derived from it.

Run this stage alone for a scene, on the files that the stage before has written:

    python stages/post.py SCENE        (or: make post SCENE=...)
"""

import argparse
import sys

import flexclear as fc


def main() -> None:
    """Run the stage and print which files went in, which came out, and what is in them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or a name below scenes/")
    for step in fc.stage(parser.parse_args().scene, "post"):
        derived = step.result
        print(step)
        for name, series in derived.data_vars.items():
            print(f"  {name} [{series.attrs.get('units', '1')}] over {', '.join(map(str, series.dims))}")


if __name__ == "__main__":
    sys.exit(fc.exit_code(main))
