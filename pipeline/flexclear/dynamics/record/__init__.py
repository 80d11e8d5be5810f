"""Record: from observed rows to the run dataset of named bodies, frames, joints, contacts and energies."""
