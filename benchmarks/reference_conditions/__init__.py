"""The verdict on reference conditions: which mode sets of rod 1 give the answers of the full rod, and at what cost."""
