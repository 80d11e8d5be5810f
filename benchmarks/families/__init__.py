"""Families of benchmarks: name -> module and attribute that declares it (`benchmarks.family.Family`)."""

KIND = "benchmark"
NAMES = {
    "evaluation": "runs:EVALUATION",
    "runs": "runs:FAMILY",
    "commands": "commands:FAMILY",
    "cold": "runs:COLD",
    "growth": "growth:FAMILY",
    "ensembles": "ensembles:FAMILY",
    "peers": "peers:FAMILY",
    "exudyn": "exudyn:FAMILY",
    "integrators": "integrators:FAMILY",
    "accuracy": "accuracy:FAMILY",
    "solids": "solids:FAMILY",
    "stability": "stability:FAMILY",
    "classes": "classes:FAMILY",
    "faults": "faults:FAMILY",
    "reference-conditions": "reference_conditions:FAMILY",
    "geometry": "geometry:FAMILY",
    "sweep": "sweep:FAMILY",
    "gallery": "gallery:FAMILY",
    "plan": "plan:FAMILY",
    "effects": "effects:FAMILY",
    "turning": "turning:FAMILY",
    "robots": "robots:FAMILY",
}
