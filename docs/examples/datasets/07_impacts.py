"""Table of impacts as a pandas DataFrame, hardest first."""

columns = ["impact_approach_speed", "impact_separation_speed", "impact_peak_force", "impact_duration"]
table = post[columns].to_dataframe().sort_values("impact_peak_force", ascending=False)
print(table[["impact_time", "impact_contact", "impact_peak_force"]].head())
