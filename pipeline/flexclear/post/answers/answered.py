"""Datasets that answer a question: in a notebook they show the answer first, then their variables."""

from __future__ import annotations

import html

import xarray as xr

from flexclear.post.pages import small_picture


class Answered(xr.Dataset):
    """A dataset with an answer as HTML; datasets computed from it are plain, without the answer."""

    __slots__ = ("_answer",)

    def _repr_html_(self) -> str:
        return f"{getattr(self, '_answer', '')}{super()._repr_html_()}"


def answered(data: xr.Dataset, text: str, picture: bytes | None = None, table: str = "") -> Answered:
    """Return the dataset with an answer: text, a picture as PNG, a table as HTML."""
    result = Answered(data.data_vars, coords=data.coords, attrs=data.attrs)
    image = "" if picture is None else small_picture(picture)
    result._answer = f"<p>{html.escape(text)}</p>{image}{table}"
    return result
