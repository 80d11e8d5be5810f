"""Numbers that Wang & Wang (2019), Mech. Mach. Theory 137, 83-107, print, in the paper's own units."""

from __future__ import annotations

from dataclasses import dataclass

from papers import rows

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
    """A row of Table 1: mass [kg], length [mm], moments of inertia [kg mm^2] as printed; None for missing values."""

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


#: place in the paper, what is wrong or missing there, and what this project does
DISCREPANCIES = rows("""
Fig. 1, section 2 | Joint coordinates, the start height and which way the legs lean are not printed; equal squares above
    each other would be singular. | Of five numbers of a symmetric layout two are fitted to angle and displacement of
    Table 8, three chosen by a rule; velocities, accelerations and forces are predictions, and Table 8's velocity
    contradicts them, see [geometry.md](geometry.md). The layout that was assumed before is next to Table 8, in the
    scenes sps4/variants/first*.
Table 3, eq. (25) | The coefficient of restitution of the contact law is not printed anywhere. | 0.9 is assumed. The law
    itself delivers more than it is asked for: the number is below Table 8, and as contact_delivered_restitution in the
    run.
eqs. (27), (28) | Both carry a minus sign; taken together friction would push along the sliding velocity. | The force is
    against the sliding velocity: it always dissipates.
eqs. (28), (29) | STEP is called with its first argument above its second, for which its definition gives a constant. |
    The arguments are put in ascending order: the coefficient falls from the static to the dynamic one between the two
    velocities.
Tables 4 and 5 | The printed frequencies do not belong to a round rod: its torsion is 2 % low. | They are reproduced
    with the mass inertia of the square of equal area; the dynamics uses the circle.
sections 3.4, 6.2 | The number of modes in the dynamic runs is not printed. | Counts that keep pairs of equal
    frequencies together, and one Craig-Bampton basis with the rod's full static compliance, as an addition.
section 5.1 | The material point P of the prismatic joint on the flexible rod is not given. | The rod's lower end is
    assumed. With both joints at the end nodes fixed-fixed modes cannot change the distance between them.
eq. (35) | The drives of legs 3 and 4 are not stated; the printed motion has jumps of acceleration at its start and end.
    | Legs 3 and 4 are held; the solver stops at each break of the drive and uses one-sided values.
Table 6, section 6.1 | One step of 0.00001 s is listed, longer than friction's fastest rate allows, and contact is taken
    as open below a penetration of 1e-10. | The step follows a tolerance; the instants of first and last touch are
    located.
section 6 | Whether gravity acts, and how the ball lies in its socket at the start, is not said. | No gravity, the ball
    concentric and at rest; a variant of the scene has gravity.
Table 1 | The opening of the sockets is not given; with the balls' stems as thick as the inertias imply, a stem would
    touch its socket's lip at the largest tilts. | Sockets have no lip: only ball and socket touch.
Figs. 14-16 | The plots are called Poincaré maps; one stroke has no period to strobe, so they are phase plots. | Phase
    plots as printed, and next to them the states at the instants when impacts begin.
Fig. 13, Table 9 | Single runs of the model with flexible rod and clearance are compared point by point. | Without
    structural damping such runs part after some tens of milliseconds under any change; beyond that only ensembles are
    compared.
Table 10 | A step and a tolerance of the integration are printed, but not which of them the CPU ratios were taken with,
    nor the errors of the runs. | Times of the integration alone, at equal error, at the step and at the tolerance.
""")
