"""Wang & Wang (2019): the 4-SPS/PS mechanism, its figures, tables and report."""

#: pages of the project that the report shows, by name: heading, sections, endings of the pictures
DOCUMENTS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "accuracy": ("Accuracy against time", ("What to choose", "sps4/csj", "sps4/far_csj_cb"), ("work_precision.png",)),
    "stability": (
        "Stability: hard cases, and what became of each",
        ("", "One parameter at a time"),
        ("sweeps.png",),
    ),
    "chaos": ("Periodic or chaotic", ("", "sps4/csj", "sps4/far_csj_cb"), (".png",)),
    "reference-conditions": (
        "Reference conditions of the modes",
        ("In short", "What holds of the paper's statements"),
        (),
    ),
}
