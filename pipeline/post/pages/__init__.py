"""What pages are made of: style, scripts, and the viewer; each page carries its own copy."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

from flexclear.pipeline.core.system.file_dependencies import note


def asset(name: str) -> str:
    """Text of a file of this folder: ``page.css``, ``page.js``, ``viewer.js``.

    Read anew for each page: what a task reads is among the facts of its key.
    """
    path = Path(__file__).parent / name
    note(path)
    return path.read_text(encoding="utf-8")


def viewer(content: dict[str, Any], caption: str, *, play: bool = False) -> str:
    """A view that can be turned, as a figure; the page needs its script.

    content: what `pipeline.post.render.player` makes.  play: whether it moves at once, unless the system asks for rest.
    """
    moving = "shapes" not in content
    still = moving and len(content["times"]) < 2
    tools = [] if still else ["<button type='button' data-part='play' aria-pressed='false'>Play</button>"]
    last = len(content["times"]) - 1 if moving else 0
    if still:
        tools.append("<label><input type='checkbox' data-part='names' checked> names</label>")
    elif moving:
        tools.append(f"<label>time <input type='range' data-part='time' min='0' max='{last}' value='0'></label>")
    elif len(content["shapes"]) > 1:
        options = "".join(
            f"<option value='{k}'>{html.escape(shape['label'])}</option>" for k, shape in enumerate(content["shapes"])
        )
        tools.append(f"<label>mode <select data-part='shape'>{options}</select></label>")
    if any("fields" in mesh for mesh in content["meshes"]):
        tools.append(
            "<label>deformation <input type='range' data-part='factor' min='-1' max='1' step='0.05' value='0'></label>"
        )
        tools.append("<span class='viewer-scale'>0 <i></i> <span></span></span>")
    tools.append("<button type='button' data-part='home'>Reset view</button>")
    label = f"{caption}: drag or arrow keys turn, plus and minus zoom, space plays"
    # a closing tag inside of the data would end the script
    data = json.dumps(content, separators=(",", ":")).replace("</", "<\\/")
    return (
        f"<figure><figcaption>{html.escape(caption)}</figcaption>"
        f"<div class='viewer' data-play='{'yes' if play else 'no'}'>"
        f"<div class='viewer-stage'><canvas tabindex='0' role='img' aria-label='{html.escape(label, quote=True)}'>"
        "</canvas><div class='viewer-names'></div><div class='viewer-ruler'><i></i><span></span></div></div>"
        f"<div class='viewer-tools'>{''.join(tools)}</div><p class='viewer-state' aria-live='off'></p>"
        f"<script type='application/json'>{data}</script></div></figure>\n"
    )


def figures_of(page: str) -> str:
    """The views of a page of this program, to be put into another one."""
    return "".join(
        re.findall(r"<figure><figcaption>[^<]*</figcaption><div class='viewer'.*?</figure>\n", page, re.DOTALL)
    )
