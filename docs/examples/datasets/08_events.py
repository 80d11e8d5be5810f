"""Events of one kind: when the pin left the journal, and how long it had touched it."""

leaving = run.isel(event=(run["event_kind"] == "opening").values)
touching = run.isel(event=((run["event_kind"] == "closing") & (run["event_contact"] == "pin")).values)
print(leaving["event_time"].values, touching["event_duration"].values)
