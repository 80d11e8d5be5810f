"""Mechanism of a scene: links, joints and closures, numbered, in the arrays that compiled functions take."""
