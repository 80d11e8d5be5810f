"""Largest values and when they were, for joints, contacts, drives and sections."""

forces = post[["peak_reaction", "peak_reaction_time"]].to_dataframe()
hardest = post["peak_force"].sel(contact="pin").item(), post["peak_force_time"].sel(contact="pin").item()
stress = run["peak_von_mises_stress"].max("section")
worst_stress, its_time = stress.max().item(), stress.idxmax("time").item()  # [Pa], [s]
