"""Tables, figures and pages in the look of the program, for programs on top of it; imports Matplotlib."""

from flexclear.post.body_shape import rod_surface, scale_to
from flexclear.post.pages import Part, downloads, figures_of, media, page, prose
from flexclear.post.plotting import style, table
from flexclear.post.plotting.mode_sheet import View, shell, triad, tube, view
from flexclear.post.plotting.table import Table, as_csv, as_html, from_markdown


def files(name: str, made: Table | style.Figure) -> dict[str, bytes]:
    """Return the files of a table, ``.csv`` and ``.md``, or of a figure, ``.png`` and ``.svg``."""
    return table.files(name, made) if isinstance(made, Table) else style.files(name, made)
