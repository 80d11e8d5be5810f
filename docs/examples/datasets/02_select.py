"""Select by name and time: one body, one component, a stretch of the run."""

x = run["position"].sel(body="slider", axis="x", time=slice(0.01, 0.02))  # [m]
force = run["joint_force"].sel(joint="main").sel(time=0.015, method="nearest")  # [N], on the joint's second body
of_the_rod = run["frame_position"].isel(frame=(run["frame_body"] == "rod").values)
