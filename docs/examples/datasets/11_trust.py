"""What a run says of itself: horizon, energy, assumptions, references."""

import json

believed = run.sel(time=slice(None, float(run["horizon"])))  # beyond, single values mean nothing
energy = float(abs(run["energy_error"]).max() / run["kinetic"].max())
assumed = json.loads(post.attrs["assumptions"])  # place in the scene -> why
print(run.attrs["source"], run.attrs["references"], run.attrs.get("warnings", ""), sep="\n")
