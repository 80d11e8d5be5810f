"""How the rod bends: its modal coordinates, and where its nodes are in the body frame."""

import xarray as xr

q = run["modal_coordinate"].isel(mode=(run["mode_body"] == "rod").values)  # [m], modal mass 1 kg
q = q.assign_coords(mode=q["mode_number"].values)  # the numbers of the bundle
bent = bundle["node_position"] + xr.dot(bundle["shape_translation"], q, dim="mode")  # (node, axis, time) [m]
loudest = q.std("time").idxmax("mode").item()
print(f"mode {loudest} at {bundle['frequency'].sel(mode=loudest).item():.0f} Hz")
