"""Mechanics as routines: bodies, joints and closures are objects of vectors and matrices, on which routines act."""
