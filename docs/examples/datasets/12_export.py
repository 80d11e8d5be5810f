"""Export: CSV for a spreadsheet, a .mat file, a smaller NetCDF file."""

from scipy.io import savemat

slider = run["position"].sel(body="slider").to_pandas()  # rows time, columns x, y, z
slider.to_csv("slider.csv")
savemat("forces.mat", {"time": run["time"].values, "pin": run["contact_force"].sel(contact="pin").values})
run[["position", "joint_force"]].sel(time=slice(0.0, 0.01)).drop_encoding().to_netcdf("first.nc")
