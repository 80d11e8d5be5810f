"""Friction of ideal joints from their reactions; friction of given strength is a load (`loads.joint_friction`)."""
