"""From observed rows to the run dataset: named bodies, frames, joints, contacts, energies.

What is recorded only where a scene's ``[output]`` asks for it is listed here.
"""

KIND = "record on request"
NAMES = {"stress": "stress:record"}
