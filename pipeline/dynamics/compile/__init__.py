"""The compiled functions of a mechanism, composed of the kernels of the parts present."""
