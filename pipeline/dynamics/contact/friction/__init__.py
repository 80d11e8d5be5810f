"""Friction laws. To add one: a module here, a line below; the property tests pick it up.

Each module has a class with
- ``traction(z, slip, f_n, p) -> (force, loss, stored, z_rate)``: kernel; force [N] on the ball against
  the sliding velocity `slip` [m/s] (vector in the tangent plane), what it takes [W] >= 0, what it holds [J],
  and the rate of its bristles z [m] in the axes of slip (zeros for a law without memory);
- ``parameters(law)``: six numbers p, and ``stick_speed(law)``: sliding speed below which it sticks [m/s],
  0 where the law has no such regime;
- ``bristle(law)``: the size of z [m], or None for a law without memory.
A joint without friction names none.
"""

KIND = "friction law"
NAMES = {
    "modified-coulomb": "modified_coulomb:ModifiedCoulomb",
    "ambrosio": "ambrosio:Ambrosio",
    "lugre": "lugre:LuGre",
}
