"""The stability atlas: hard cases of the clearance mechanism, and what became of each."""
