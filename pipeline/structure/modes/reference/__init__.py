"""Reference conditions: what ties the body frame to the deforming body, and so which shapes are admissible.

To add one: a module here with ``basis(beam, count, interfaces) -> Basis``, and a line below.
"""

KIND = "reference condition"
NAMES = {
    "free-free": "free_free:basis",
    "fixed-fixed": "fixed_fixed:basis",
    "craig-bampton": "craig_bampton:basis",
}
