"""Wang & Wang (2019): the 4-SPS/PS mechanism, its figures, tables and report."""
