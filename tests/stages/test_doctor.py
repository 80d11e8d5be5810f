"""``flexclear doctor`` tells what is there, computes something with a known answer, and says when it does not."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from flexclear.stages import doctor
from flexclear.stages.__main__ import main


def test_the_doctor_finds_this_place_well(capsys: pytest.CaptureFixture[str]):
    assert main(["doctor"]) == 0
    told = capsys.readouterr().out
    assert "WRONG" not in told
    assert "a free fall of 0.1 s ends at -0.04905 m" in told


def test_the_doctor_says_what_is_wrong(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(doctor, "_self_test", lambda: ("it fell upwards", False))
    assert main(["doctor"]) == 4
    told = capsys.readouterr()
    assert "WRONG  self-test  it fell upwards" in told.out
    assert "not well: self-test" in told.err


def test_threads_that_somebody_asks_for_do_not_change_bytes(root: Path):
    """Sums over several threads are added in another order; the libraries read this when they are loaded."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")
    code = f"import os, pipeline; print([os.environ[name] for name in {names}])"
    environment = {**os.environ, **dict.fromkeys(names, "2")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "['1', '1']"
