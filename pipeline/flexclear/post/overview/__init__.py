"""General figures of any mechanism: of a run, of runs next to each other, and of a sweep."""
