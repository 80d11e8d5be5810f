"""Independently computed solutions of turning beams, to compare runs with.

WRIGHT: flapping and lagging frequencies of a uniform cantilever on a hub without radius, in units of
sqrt(E I / (rho A)) / L^2, by speed Gamma in the same unit; by Frobenius series, all 39 flapping values agree with
Wright, Smith, Thresher & Wang (1982), J. Applied Mechanics 49, 197-202, to their last digit.

SPIN_UP: tip of a cantilever that is spun up, by assumed modes (6 bending, 6 axial) with and without the foreshortening,
integrated to 1e-11: time [s], deflection across the undeformed axis [m], stretch of the axis [m], foreshortening [m].
"""

import json
from pathlib import Path

_NUMBERS = json.loads((Path(__file__).parent / "turning_beams.json").read_text())
#: Gamma -> (flapping, lagging)
WRIGHT = {int(gamma): pair for gamma, pair in _NUMBERS["wright"].items()}
SPIN_UP = _NUMBERS["spin_up"]
