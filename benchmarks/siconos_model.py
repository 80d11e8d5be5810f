"""Run a mechanism with loose joints in Siconos, by the Python that Siconos belongs to.

Arguments: "crank" or "four_bar", the C source of its functions, step [s], end [s], coefficient of friction. Writes
processor time of the steps [s], and at each 0.1 ms the time and a height [m], as JSON: of the slider of Flores, Leine &
Glocker (2010), or of the middle of the rocker of `scenes/checks/clearance_four_bar.toml`.
Moreau's time stepping with the midpoint rule; Newton's impact law.
"""

import ctypes
import json
import math
import os
import subprocess
import sys
import tempfile
import time

#: start, speeds, gaps, restitution, and the height of a state
CRANK = (
    [0.0, 0.0, 0.0],
    [150.0, -75.0, 0.0],
    4,
    0.4,
    lambda q: 0.153 * math.sin(q[0]) + 0.306 * math.sin(q[1]),
)
LEAN = 0.7227342478134157
FOUR_BAR = (
    [0.0, 0.2125, 0.09921567416492215, LEAN, 0.3125, 0.09921567416492215, 2.0 * LEAN],
    [0.0] * 7,
    3,
    0.8,
    lambda q: q[5],
)


def main(which, source, step, end, friction):
    start, speeds, gaps, restitution, height = CRANK if which == "crank" else FOUR_BAR
    with tempfile.TemporaryDirectory() as folder:
        library = os.path.join(folder, "Functions.so")
        name = "-Wl,-soname,Functions.so"  # by which Siconos finds it once it is loaded
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", name, "-o", library, source, "-lm"], check=True)
        ctypes.CDLL(library, ctypes.RTLD_GLOBAL)
        simulation, system = model(start, speeds, gaps, restitution, step, end, friction)
        rows, every, count = [], round(1e-4 / step), 0
        begun = time.process_time()
        while simulation.hasNextEvent():
            simulation.computeOneStep()
            count += 1
            if count % every == 0:
                rows.append([count * step, height(system.q())])
            simulation.nextStep()
        print(json.dumps({"s": time.process_time() - begun, "rows": rows}))


def model(start, speeds, gaps, restitution, step, end, friction):
    import siconos.kernel as siconos

    system = siconos.LagrangianDS(start, speeds)
    system.setComputeMassFunction("Functions", "mass")
    system.setComputeFGyrFunction("Functions", "forces")
    whole = siconos.NonSmoothDynamicalSystem(0.0, end)
    whole.insertDynamicalSystem(system)
    rough, smooth = siconos.NewtonImpactFrictionNSL, siconos.NewtonImpactNSL
    law = rough(restitution, 0.0, friction, 2) if friction else smooth(restitution)
    for k in range(gaps):
        contact = siconos.LagrangianScleronomousR(f"Functions:gap{k}", f"Functions:slope{k}")
        whole.link(siconos.Interaction(law, contact), system)
    problem = siconos.FrictionContact(2) if friction else siconos.LCP()
    if friction:
        options = problem.numericsSolverOptions()
        options.dparam[0], options.iparam[0] = 1e-12, 10000  # tolerance and iterations; by default an error of 1e-4
    times = siconos.TimeDiscretisation(0.0, step)
    simulation = siconos.TimeStepping(whole, times, siconos.MoreauJeanOSI(0.5), problem)
    simulation.setNewtonTolerance(1e-10)
    simulation.setNewtonMaxIteration(30)
    return simulation, system


if __name__ == "__main__":
    main(*sys.argv[1:3], *map(float, sys.argv[3:6]))
