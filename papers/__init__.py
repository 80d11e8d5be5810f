"""Papers that this program reproduces, one folder each: applications, run by ``python -m papers.<name>``."""

from pathlib import Path

#: folder of the project, with the scenes and pages that papers read
PROJECT = Path(__file__).absolute().parents[1]
