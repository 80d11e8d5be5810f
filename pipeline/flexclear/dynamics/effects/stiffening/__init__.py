"""Stiffening of flexible bodies by forces and accelerations."""
