"""Kernels of the equations of motion: kinematics, forces, closures, projection and recorded outputs."""
