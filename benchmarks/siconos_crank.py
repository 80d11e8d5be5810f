"""Run the slider-crank of Flores, Leine & Glocker (2010) in Siconos, by the Python that Siconos belongs to.

Arguments: the C source of its functions, step [s], end [s], coefficient of friction. Writes processor time of the
steps [s], and at each 0.1 ms the time, the height of the slider's middle [m] and its angle [rad], as JSON.
Moreau's time stepping with the midpoint rule; Newton's impact law with a restitution of 0.4.
"""

import ctypes
import json
import math
import os
import subprocess
import sys
import tempfile
import time


def main(source, step, end, friction):
    with tempfile.TemporaryDirectory() as folder:
        library = os.path.join(folder, "CrankFunctions.so")
        name = "-Wl,-soname,CrankFunctions.so"  # by which Siconos finds it once it is loaded
        subprocess.run(["cc", "-O2", "-shared", "-fPIC", name, "-o", library, source, "-lm"], check=True)
        ctypes.CDLL(library, ctypes.RTLD_GLOBAL)
        simulation, system = model(step, end, friction)
        rows, every, count = [], round(1e-4 / step), 0
        begun = time.process_time()
        while simulation.hasNextEvent():
            simulation.computeOneStep()
            count += 1
            if count % every == 0:
                q = system.q()
                rows.append([count * step, 0.153 * math.sin(q[0]) + 0.306 * math.sin(q[1]), q[2]])
            simulation.nextStep()
        print(json.dumps({"s": time.process_time() - begun, "rows": rows}))


def model(step, end, friction):
    import siconos.kernel as siconos

    system = siconos.LagrangianDS([0.0, 0.0, 0.0], [150.0, -75.0, 0.0])
    system.setComputeMassFunction("CrankFunctions", "mass")
    system.setComputeFGyrFunction("CrankFunctions", "forces")
    whole = siconos.NonSmoothDynamicalSystem(0.0, end)
    whole.insertDynamicalSystem(system)
    law = siconos.NewtonImpactFrictionNSL(0.4, 0.0, friction, 2) if friction else siconos.NewtonImpactNSL(0.4)
    for k in range(4):
        corner = siconos.LagrangianScleronomousR(f"CrankFunctions:gap{k}", f"CrankFunctions:slope{k}")
        whole.link(siconos.Interaction(law, corner), system)
    problem = siconos.FrictionContact(2) if friction else siconos.LCP()
    times = siconos.TimeDiscretisation(0.0, step)
    simulation = siconos.TimeStepping(whole, times, siconos.MoreauJeanOSI(0.5), problem)
    simulation.setNewtonTolerance(1e-10)
    simulation.setNewtonMaxIteration(30)
    return simulation, system


if __name__ == "__main__":
    main(sys.argv[1], *map(float, sys.argv[2:5]))
