"""Friction laws. To add one: a module here that is called like the law, its parameters in core/scene/clearance,
and a case in tests/properties/test_dynamics_friction and test_dynamics_clearance.

Each module has a class, called like its parameters, with
- ``traction(z, slip, f_n, p) -> (force, loss, stored, z_rate)``: kernel; force [N] on the ball against
  the sliding velocity `slip` [m/s] (vector in the tangent plane), what it takes [W] >= 0, what it holds [J],
  and the rate of its bristles z [m] in the axes of slip (zeros for a law without memory);
- ``parameters(law)``: six numbers p, and ``stick_speed(law)``: sliding speed below which it sticks [m/s],
  0 where the law has no such regime;
- ``kinks(law)``: two sliding speeds [m/s] at which the slope or curvature of the coefficient jumps, 0 for none: steps
  end there;
- ``bristle(law)``: the size of z [m], or None for a law without memory.
A joint without friction names none.
"""

from flexclear.pipeline.core.scene.clearance import FRICTIONS
from flexclear.pipeline.core.scene.registry import declared

KIND = "friction law"
NAMES = declared(FRICTIONS, key="law")
