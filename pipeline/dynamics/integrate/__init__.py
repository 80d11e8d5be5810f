"""Integrators. To add one: a module with ``compose``, a line below, a row in the order test.

`explicit` runs any embedded Runge-Kutta pair with dense output; `events` locates contacts in its
steps, `project` keeps loops closed, `observe` evaluates what is recorded.
"""

KIND = "integrator"
NAMES = {"dop853": "dop853:METHOD"}
