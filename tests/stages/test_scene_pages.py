"""Pages of scenes: in a folder with their files, and for budgets that reach few effects."""

from __future__ import annotations

from pathlib import Path

import flexclear as fc
from flexclear.commands.report import publish_page


def test_a_page_in_a_folder_has_its_files_next_to_it(tmp_path: Path) -> None:
    page = b'<html><body><img alt="run" src="data:image/png;base64,AAAA"></body></html>'
    index = publish_page(tmp_path / "runs" / "ball", "report", page, folder=True)
    assert index == tmp_path / "runs" / "ball" / "report" / "index.html"
    assert index.is_file()


def test_a_budget_that_reaches_one_effect_names_the_others() -> None:
    answer = fc.effects("checks/bounce", budget=1e-6)
    assert answer.attrs["undone"]
    assert any(answer["words"].values), "the effect that is all of the ideal mechanism's difference costs nothing more"
