"""Derived series, maps, tables, pictures and reports from datasets. Reads artifacts, imports no other tower."""
