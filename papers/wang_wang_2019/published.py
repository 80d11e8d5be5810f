"""The numbers that Wang & Wang (2019), Mech. Mach. Theory 137, 83-107, print, in the paper's own units."""

from __future__ import annotations

from dataclasses import dataclass

CITATION = "Wang & Wang (2019), Mechanism and Machine Theory 137, 83-107, doi:10.1016/j.mechmachtheory.2019.03.017"

#: Table 4: fixed-fixed frequencies [Hz]
TABLE4_ANSYS = (1553.7, 1553.7, 4229.7, 4229.7, 6391.0, 8356.4)
TABLE4_NORMAL_MODE = (1576.8, 1576.8, 4314.2, 4314.2, 6403.6, 8362.7)

#: Table 5: free-free frequencies [Hz], without the six zeros of the rigid-body modes
TABLE5_ANSYS = (1565.3, 1565.3, 4257.2, 4257.2, 6453.0, 8349.7)
TABLE5_NORMAL_MODE = (1563.7, 1563.7, 4254.9, 4254.9, 6403.6, 8206.5)
RIGID_MODES = 6


@dataclass(frozen=True, slots=True)
class MaximumError:
    """One column of tables 7-9: largest differences from the ideal model."""

    angle: float  #: [rad]
    displacement: float  #: [mm]
    velocity: float  #: [mm/s]


#: Table 7: FAR model
TABLE7 = {
    "free-free": MaximumError(1.900e-5, 1.000e-4, 0.190),
    "fixed-fixed": MaximumError(1.900e-5, 1.000e-4, 0.200),
}
#: Table 8: CSJ model
TABLE8 = MaximumError(1.654e-3, 1.962e-1, 13.570)
#: Table 9: FAR-CSJ model
TABLE9 = {
    "free-free": MaximumError(1.733e-3, 2.002e-1, 13.726),
    "fixed-fixed": MaximumError(1.697e-3, 2.002e-1, 13.901),
}
#: Table 10: CPU time, the ideal model's = 1; keys are the scenes of this project
TABLE10 = {
    "sps4/ideal": 1.0,
    "sps4/far_free": 1.21,
    "sps4/far_fixed": 1.15,
    "sps4/csj": 19.95,
    "sps4/far_csj_free": 39.74,
    "sps4/far_csj_fixed": 39.63,
}


@dataclass(frozen=True, slots=True)
class Part:
    """A row of Table 1: mass [kg], length [mm], moments of inertia [kg mm^2] as printed; None where it prints none."""

    mass: float | None
    length: float | None
    inertia: tuple[float, float, float] | None


#: Table 1
TABLE1 = {
    "cylinder": Part(2.08, 212.0, (7991.531, 7991.531, 415.648)),
    "actuated rod": Part(0.21, 240.0, (996.802, 996.802, 10.330)),
    "constrained cylinder": Part(1.96, 200.0, (6731.411, 6731.411, 392.121)),
    "constrained rod": Part(0.59, 240.0, (2837.976, 2837.976, 29.409)),
    "socket on moving platform": Part(0.30, None, (127.400, 98.769, 98.769)),
    "ball": Part(0.36, None, (85.866, 85.866, 46.728)),
    "socket on base platform": Part(0.30, None, None),
    "moving platform": Part(0.31, 100.0, (2080.267, 1040.159, 1040.159)),
    "base platform": Part(None, 200.0, None),
}
#: Table 2: density [kg/m^3], Poisson's ratio, Young's modulus [Pa], radius [m], length [m]
TABLE2 = {"density": 2740.0, "poisson": 0.33, "youngs_modulus": 7.17e10, "radius": 0.01, "length": 0.240}
#: Table 3: radii [m], Poisson's ratio, Young's modulus [Pa], density [kg/m^3]
TABLE3 = {
    "socket_radius": 0.0205,
    "ball_radius": 0.0200,
    "poisson": 0.29,
    "youngs_modulus": 2.068e11,
    "density": 7900.0,
}
#: Table 6: times [s], tolerance [mm], exponent, friction coefficients, velocities [mm/s]
TABLE6 = {
    "time_span": 0.18,
    "time_step": 1e-5,
    "tolerance": 0.004,
    "exponent": 1.5,
    "static": 0.15,
    "dynamic": 0.1,
    "v_static": 0.2,
    "v_dynamic": 10.0,
}
