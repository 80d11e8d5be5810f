"""Find the unit of an entry: where some slide and others turn, it stands beside them."""

import numpy as np

print(run["velocity"].attrs["units"])  # one unit for all
each = run["joint_position_units"].to_series()  # main: rad, wrist: rad, guide: m
angles = run["joint_position"].isel(coordinate=(run["coordinate_motion"] == "rotation").values)
degrees = np.rad2deg(angles)
