"""Record: from observed rows to the run dataset of named bodies, frames, joints, contacts and energies.

Variables that are recorded only where a scene's ``[output]`` requests them have a module called like their key there;
scene/output declares the keys with their variables. Such modules have ``record(motions, asked)``, which returns
variables and coordinates; asked is the key's value.
"""

from flexclear.scene.output import VARIABLES

KIND = "record on request"
NAMES = {name: f"{name}:record" for name in VARIABLES}
