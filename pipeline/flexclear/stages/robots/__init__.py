"""Mechanisms from robots' files: a URDF or MJCF, compiled by MuJoCo, becomes the text of a scene."""
