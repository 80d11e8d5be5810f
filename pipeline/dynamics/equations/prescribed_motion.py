"""Known motion: every law of time at the present time, and the prescribed coordinates from theirs."""

from __future__ import annotations

from collections.abc import Callable

from flexclear.pipeline.dynamics import memory as m
from flexclear.pipeline.dynamics.kernels import kernel


@kernel
def no_harmonics(h, f, w, law, piece, s):
    """Polynomials only."""


@kernel
def prescribe(d):
    """Prescribed coordinates, speeds and accelerations from their laws, which are the first ones."""
    for k in range(d.n_drives):
        law = d.law[k]
        d.x[d.nq + k] = law.value
        d.u[d.nv + k] = law.rate
        d.du[d.nv + k] = law.second_rate


def make_laws(harmonics: Callable | None = None) -> Callable:
    """The kernel laws(h, f, w, n, t); harmonics(h, f, w, law, piece, s) adds to value, rate, second rate."""
    add_harmonics = no_harmonics if harmonics is None else harmonics

    @kernel
    def laws(h, f, w, n, t):
        """Value, rate and second rate of every law, from its piece in force."""
        for k in range(h[m.N_LAWS]):
            piece = n[n[m.ACTIVE] + k]
            o = m.PIECES.row(h, piece)
            s = t - f[o + m.PIECES.start]
            x, v, a = f[o + m.PIECES.size - 1], 0.0, 0.0
            for c in range(m.PIECES.size - 2, 0, -1):
                a = a * s + 2.0 * v
                v = v * s + x
                x = x * s + f[o + c]
            law = m.LAW.row(h, k)
            w[law], w[law + 1], w[law + 2] = x, v, a
            add_harmonics(h, f, w, law, piece, s)

    return laws
