"""From datasets to maps, tables, pictures and the report. Reads artifacts, imports no other tower."""
