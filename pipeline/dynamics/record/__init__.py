"""From observed rows to the run dataset: named bodies, frames, joints, contacts, energies."""
