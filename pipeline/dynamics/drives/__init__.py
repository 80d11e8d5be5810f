"""Drive laws. To add one: a module here, a line below, its parameters in the scene schema.

Each module has ``pieces(law)``: rows (start time, six polynomial coefficients in the time since
then), in order; the first starts at -inf's stand-in and holds before the first break.
"""

KIND = "drive law"
NAMES = {"constant": "constant:pieces", "spin-up": "spin_up:pieces", "step": "step:pieces"}
