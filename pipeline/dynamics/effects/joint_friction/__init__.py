"""Friction of ideal joints that follows their reactions; that of given strength is a load (`loads.joint_friction`)."""
