"""Laws of time, of drives and loads. To add one: a module here, a line below, its parameters in core/scene/laws.

Each module has ``pieces(law, dimension) -> Pieces`` (see `pieces`), which raises ValueError, in
words, for values that are not of that dimension.
"""

KIND = "law"
NAMES = {
    "constant": "constant:pieces",
    "step": "step:pieces",
    "polynomial": "polynomial:pieces",
    "harmonic": "harmonic:pieces",
    "spline": "spline:pieces",
    "table": "table:pieces",
    "sum": "sum:pieces",
    "piecewise": "piecewise:pieces",
    "repeated": "repeated:pieces",
}
