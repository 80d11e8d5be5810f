"""From a scene to tables and one compiled right-hand side.

merge -> tree -> layout build the tables; kinematics -> equations -> closures are the kernels;
fuse composes those that a scene calls for; initial finds a consistent start.
"""
