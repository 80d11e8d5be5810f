"""Integrators. To add one: write a module with a `METHOD` (see `method`), a line in the table and in
`scene.integrators`, a row in the order test, and its parameters, if it has any, in `scene.solver`.

`stepper` runs any method; `adaptive` or `fixed` choose the length of its steps. `contact_events` locates the begin and
end of contacts within steps, `step_end_events` only at step ends. `contact_phases` records what happens during contact,
`guards` end steps where a friction law has a kink, `singular_step` steps over singular poses, `recording` stores rows.
Methods share `runge_kutta`, `newton`, `hermite` and `norms`.
"""

from __future__ import annotations

from flexclear.dynamics.integrate import adams, dop853, dopri5, exponential, generalized_alpha, radau, rk4

METHODS = {
    "dop853": dop853.METHOD,
    "dopri5": dopri5.METHOD,
    "rk4": rk4.METHOD,
    "adams-bashforth-moulton": adams.METHOD,
    "generalized-alpha": generalized_alpha.METHOD,
    "radau": radau.METHOD,
    "exponential": exponential.METHOD,
}
