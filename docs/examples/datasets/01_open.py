"""Open what there is of a scene, run and derived quantities in one dataset."""

import xarray as xr

import flexclear as fc

tree = fc.open("slider_crank")  # DataTree: mesh, modes and bundle by body, run, post
run, post = tree["run"].to_dataset(), tree["post"].to_dataset()
bundle = tree["bundle/rod"].to_dataset()
both = xr.merge([run, post], compat="equals")  # the same names mean the same, so that nothing conflicts
