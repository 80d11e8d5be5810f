"""Explicit Runge-Kutta method of order 8 by Dormand and Prince, dense output of order 7.

Source: Hairer, Norsett & Wanner, *Solving Ordinary Differential Equations I*, 2nd ed. (1993), sec. II.5 (method and
error estimate) and II.6 (dense output); coefficients: their code dop853.f, exact in double precision.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexclear.dynamics import memory as m
from flexclear.dynamics.integrate.method import Method, begin_afresh, keep_nothing, slope
from flexclear.dynamics.integrate.norms import error_scale
from flexclear.dynamics.integrate.runge_kutta import make_dense, make_stages
from flexclear.dynamics.kernels import kernel
from flexclear.scene.integrators import INTEGRATORS

#: stages of the step, and with those of its end and of the dense output
STAGES, EXTENDED, ERROR_ORDER = 12, 16, 7
# fmt: off
#: nodes; 12 is the end of the step, 13 to 15 serve the dense output
C = np.array([
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274, 0.2816496580927726, 0.3333333333333333, 0.25,
    0.3076923076923077, 0.6512820512820513, 0.6, 0.8571428571428571, 1.0, 1.0, 0.1, 0.2, 0.7777777777777778,
])
#: weights of the stages
A = np.zeros((EXTENDED, EXTENDED))
A[1, 0] = 0.05260015195876773
A[2, [0, 1]] = 0.0197250569845379, 0.0591751709536137
A[3, [0, 2]] = 0.02958758547680685, 0.08876275643042054
A[4, [0, 2, 3]] = 0.2413651341592667, -0.8845494793282861, 0.924834003261792
A[5, [0, 3, 4]] = 0.037037037037037035, 0.17082860872947386, 0.12546768756682242
A[6, [0, 3, 4, 5]] = 0.037109375, 0.17025221101954405, 0.06021653898045596, -0.017578125
A[7, [0, 3, 4, 5, 6]] = (
    0.03709200011850479, 0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023,
)
A[8, [0, 3, 4, 5, 6, 7]] = (
    0.6241109587160757, -3.3608926294469414, -0.868219346841726, 27.59209969944671, 20.154067550477894,
    -43.48988418106996,
)
A[9, [0, 3, 4, 5, 6, 7, 8]] = (
    0.47766253643826434, -2.4881146199716677, -0.590290826836843, 21.230051448181193, 15.279233632882423,
    -33.28821096898486, -0.020331201708508627,
)
A[10, [0, 3, 4, 5, 6, 7, 8, 9]] = (
    -0.9371424300859873, 5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
    22.739487099350505, 2.4936055526796523, -3.0467644718982196,
)
A[11, [0, 3, 4, 5, 6, 7, 8, 9, 10]] = (
    2.273310147516538, -10.53449546673725, -2.0008720582248625, -17.9589318631188, 27.94888452941996,
    -2.8589982771350235, -8.87285693353063, 12.360567175794303, 0.6433927460157636,
)
A[12, [0, 5, 6, 7, 8, 9, 10, 11]] = (
    0.054293734116568765, 4.450312892752409, 1.8915178993145003, -5.801203960010585, 0.3111643669578199,
    -0.1521609496625161, 0.20136540080403034, 0.04471061572777259,
)
A[13, [0, 6, 7, 8, 9, 10, 11, 12]] = (
    0.056167502283047954, 0.25350021021662483, -0.2462390374708025, -0.12419142326381637, 0.15329179827876568,
    0.00820105229563469, 0.007567897660545699, -0.008298,
)
A[14, [0, 5, 6, 7, 10, 11, 12, 13]] = (
    0.03183464816350214, 0.028300909672366776, 0.053541988307438566, -0.05492374857139099, -0.00010834732869724932,
    0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325,
)
A[15, [0, 5, 6, 7, 8, 12, 13, 14]] = (
    -0.42889630158379194, -4.697621415361164, 7.683421196062599, 4.06898981839711, 0.3567271874552811,
    -0.0013990241651590145, 2.9475147891527724, -9.15095847217987,
)
#: weights of the step, equal to those of the stage at its end, and of the error estimates of third and fifth order
B = A[STAGES, :STAGES].copy()
E3 = np.array([
    -0.18980075407240762, 0.0, 0.0, 0.0, 0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082,
])
E5 = np.array([
    0.01312004499419488, 0.0, 0.0, 0.0, 0.0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
])
#: weights of all slopes in the last four coefficients of the dense output
D, SEEN = np.zeros((4, EXTENDED)), [0, *range(5, EXTENDED)]
D[0, SEEN] = (
    -8.428938276109013, 0.5667149535193777, -3.0689499459498917, 2.38466765651207, 2.117034582445028,
    -0.871391583777973, 2.2404374302607883, 0.6315787787694688, -0.08899033645133331, 18.148505520854727,
    -9.194632392478356, -4.436036387594894,
)
D[1, SEEN] = (
    10.427508642579134, 242.28349177525817, 165.20045171727028, -374.5467547226902, -22.113666853125306,
    7.733432668472264, -30.674084731089398, -9.332130526430229, 15.697238121770845, -31.139403219565178,
    -9.35292435884448, 35.81684148639408,
)
D[2, SEEN] = (
    19.985053242002433, -387.0373087493518, -189.17813819516758, 527.8081592054236, -11.57390253995963,
    6.8812326946963, -1.0006050966910838, 0.7777137798053443, -2.778205752353508, -60.19669523126412,
    84.32040550667716, 11.99229113618279,
)
D[3, SEEN] = (
    -25.69393346270375, -154.18974869023643, -231.5293791760455, 357.6391179106141, 93.40532418362432,
    -37.45832313645163, 104.0996495089623, 29.8402934266605, -43.53345659001114, 96.32455395918828,
    -39.17726167561544, -149.72683625798564,
)
# fmt: on


@kernel
def error(d, step):
    """Return the norm of the local error, 1 at the tolerance."""
    size, k = d.ny, slope(d, 0)
    five = three = 0.0
    for c in range(size):
        a = b = 0.0
        for j in range(STAGES):
            a += E5[j] * d.w[k + j * size + c]
            b += E3[j] * d.w[k + j * size + c]
        s = 1.0 / error_scale(d, c)
        a, b = a * s, b * s
        five += a * a
        three += b * b
    if five == 0.0 and three == 0.0:
        return 0.0
    return abs(step) * five / np.sqrt((five + 0.01 * three) * size)


extend_step, interpolate = make_dense(STAGES, D)


def make_kernels(evaluate: Callable, lists: object) -> tuple:
    """Build the method's kernels."""
    stage, proceed = make_stages(evaluate, A, B, C)

    @kernel
    def extend(d, step):
        """Prepare the dense output of the step to Y_NEW, whose slope is in row STAGES."""
        for i in range(STAGES + 1, EXTENDED):
            stage(d, step, i)
        extend_step(d, step)

    return begin_afresh, proceed, error, extend, keep_nothing


METHOD = Method(
    traits=INTEGRATORS["dop853"],
    room=m.Room(EXTENDED + 1, 8),
    last=STAGES,
    make_kernels=make_kernels,
    interpolate=interpolate,
    error_order=ERROR_ORDER,
    staged=True,
    stability=6.1,  # Hairer & Wanner, Solving Ordinary Differential Equations II, sec. IV.2, and their code
)
