"""Processor time of each scene of the paper, warm, and per evaluation of the right-hand side."""

from __future__ import annotations

import numpy as np

from stages.report import Scenes
from stages.run import check, workplace
from stages.timing import REPEATS, run


def main() -> None:
    """Print one line per scene: median time, spread over the repeats, evaluations, time of one."""
    place = workplace()
    task = Scenes().timing("sps4")
    outcome = place.bring(list(task.inputs.values()))
    check(outcome)
    bundles = {name: place.store.load(outcome.records[id(above)]) for name, above in task.inputs.items()}
    measured = run(task.params, bundles, lambda fraction, text: None)["nc"]
    print(f"{'scene':<20} {'median s':>10} {'spread':>8} {'evaluations':>12} {'us each':>9}   ({REPEATS} repeats)")
    for scene in measured.scene.values:
        seconds, count = measured.cpu_seconds.sel(scene=scene).values, int(measured.evaluations.sel(scene=scene))
        median = float(np.median(seconds))
        spread = float(np.ptp(seconds)) / median
        print(f"{scene!s:<20} {median:>10.4f} {spread:>8.1%} {count:>12} {1e6 * median / count:>9.2f}")


if __name__ == "__main__":
    main()
