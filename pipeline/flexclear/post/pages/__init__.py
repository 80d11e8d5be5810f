"""Self-contained pages: style, scripts, pictures, films and viewer are inside, so that one file can be sent."""

from __future__ import annotations

import base64
import html
import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


def asset(name: str) -> str:
    """Return the text of a file of this folder: ``page.css``, ``page.js``, ``viewer.js``, ``live.js``."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8")


def viewer(content: dict[str, Any], caption: str, *, play: bool = False) -> str:
    """Return an interactive view as a figure; the page needs the viewer's script.

    content: from `post.render.player`.  play: start the motion, unless the system asks for rest.
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
    # a closing tag in the data would end the script
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
    """Return the views of a page of this program, as parts of another page."""
    return "".join(
        re.findall(r"<figure><figcaption>[^<]*</figcaption><div class='viewer'.*?</figure>\n", page, re.DOTALL)
    )


#: media types by suffix of a file
TYPES = {
    "png": "image/png",
    "webp": "image/webp",
    "jpg": "image/jpeg",
    "svg": "image/svg+xml",
    "mp4": "video/mp4",
    "gif": "image/gif",
}


@dataclass(frozen=True, slots=True)
class Part:
    """A part of the page: its key, its heading, its HTML."""

    key: str
    heading: str
    body: str


def page(title: str, lead: str, parts: Sequence[Part], answer: str = "") -> bytes:
    """Return the page with all parts that are not empty; it loads nothing from elsewhere.

    answer: HTML at the top.
    """
    shown = [part for part in parts if part.body]
    body = "".join(
        f"<section aria-labelledby='{part.key}'><h2 id='{part.key}'>{html.escape(part.heading)}</h2>\n"
        f"{part.body}</section>\n"
        for part in shown
    )
    links = "".join(f"<li><a href='#{part.key}'>{html.escape(part.heading)}</a></li>" for part in shown)
    contents = f"<nav aria-label='Contents'><ul>{links}</ul></nav>\n" if len(shown) > 1 else ""
    top = f"<div class='answer'>{answer}</div>\n" if answer else ""
    below = f"<p class='lead'>{html.escape(lead)}</p>\n" if lead else ""
    live = "class='live'" in body
    scripts = [asset("page.js")] + ([asset("viewer.js")] if live or "class='viewer'" in body else [])
    scripts += [asset("live.js")] if live else []
    text = (
        "<!doctype html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'><link rel='icon' href='data:,'>"
        f"<title>{html.escape(title)}</title><style>{asset('page.css')}</style></head>\n<body>"
        f"<a class='skip' href='#main'>Skip to the content</a><main id='main'><h1>{html.escape(title)}</h1>\n"
        f"{below}{top}{contents}{body}</main>{''.join(f'<script>{text}</script>' for text in scripts)}</body></html>\n"
    )
    return text.encode()


def viewer_page(title: str, views: Sequence[str], below: str = "") -> bytes:
    """Return a page with interactive views (`post.pages.viewer`), and HTML below them."""
    return page(title, "", [Part("view", "View" if len(views) == 1 else "Views", in_columns(views) + below)])


def live_page(title: str, views: Sequence[str], beside: str, version: int) -> bytes:
    """Return a page that replaces its content by that of the server it came from, when that has another version."""
    shown = f"<div class='live' data-version='{version}'><div>{''.join(views)}</div><div>{beside}</div></div>\n"
    return page(title, "", [Part("live", "Live view", shown)])


def findings(caption: str, records: Iterable[Mapping[str, Any]], notes: Sequence[str] = ()) -> str:
    """Return errors and warnings of files as a list in the order of their lines, and sentences below it.

    records: severity, file, line, place, problem, remedy, and the text of the line.
    """
    items = "".join(
        f"<li class='{record['severity']}'><b>{html.escape(where)}</b> {html.escape(record['place'])} "
        f"{html.escape(record['problem'])}"
        + (f"<pre>{html.escape(record['text'])}</pre>" if record.get("text") else "")
        + (f"<p>{html.escape(record['remedy'])}</p>" if record["remedy"] else "")
        + "</li>\n"
        for record in sorted(records, key=lambda one: (one["severity"], one["file"] or "", one["line"] or 0))
        for where in [f"{record['severity']}, {Path(record['file']).name} line {record['line']}" if record["line"]
                      else record["severity"]]
    )  # fmt: skip
    below = "".join(f"<p>{html.escape(note)}</p>" for note in notes)
    return f"<figure class='findings'><figcaption>{html.escape(caption)}</figcaption><ul>{items}</ul>{below}</figure>\n"


def in_columns(figures: Sequence[str]) -> str:
    """Return figures in columns where the screen is wide enough."""
    return "".join(figures) if len(figures) < 2 else f"<div class='side-by-side'>{''.join(figures)}</div>\n"


def media(name: str, content: bytes, caption: str, alt: str = "") -> str:
    """Return a picture or film as part of the page; alt: its description, where the caption is not enough."""
    kind = TYPES[name.rpartition(".")[2]]
    data = f"data:{kind};base64,{base64.b64encode(content).decode()}"
    alt_text = html.escape(alt or caption, quote=True)
    shown = (
        f"<video src='{data}' controls loop muted playsinline aria-label='{alt_text}'></video>"
        if kind.startswith("video")
        else f"<img src='{data}' alt='{alt_text}'>"
    )
    look = "" if kind.startswith("video") else " class='plot'"
    return f"<figure{look}><figcaption>{html.escape(caption)}</figcaption>{shown}</figure>\n"


def small_picture(png: bytes) -> str:
    """Return a picture for a notebook."""
    return f"<img style='max-width:min(100%,36em)' alt='' src='data:image/png;base64,{base64.b64encode(png).decode()}'>"


def prose(heads: Sequence[str], rows: Collection[Sequence[str]]) -> str:
    """Return a table of sentences, with `backticks` as code; empty without rows."""
    if not rows:
        return ""
    head = "".join(f"<th scope='col'>{html.escape(text)}</th>" for text in heads)
    lines = "".join("<tr>" + "".join(f"<td>{_code(cell)}</td>" for cell in row) + "</tr>\n" for row in rows)
    table = f"<table class='prose'><thead><tr>{head}</tr></thead><tbody>\n{lines}</tbody></table>"
    return f"<figure><div class='scroll' tabindex='0'>{table}</div></figure>\n"


def downloads(files: Mapping[str, bytes]) -> str:
    """Return links that save small files from the page, by name."""
    if not files:
        return ""
    kinds = {"csv": "text/csv", "toml": "text/plain", "bib": "text/plain", "md": "text/markdown"}
    items = "".join(
        f"<li><a download='{html.escape(name)}' href='data:{kinds.get(name.rpartition('.')[2], 'text/plain')};"
        f"base64,{base64.b64encode(content).decode()}'>{html.escape(name)}</a> ({len(content) / 1e3:.3g} kB)</li>"
        for name, content in files.items()
    )
    return f"<ul>{items}</ul>\n"


def in_folder(page: bytes) -> dict[str, bytes]:
    """Return a page as ``index.html`` with its pictures and films as files next to it, by name."""
    files: dict[str, bytes] = {}
    suffix = {kind: name for name, kind in TYPES.items()}

    def extracted(match: re.Match[str]) -> str:
        content = base64.b64decode(match[2])
        name = f"files/{len(files) + 1:03d}.{suffix[match[1]]}"
        files[name] = content
        return f"src='{name}'"

    text = re.sub(r"src='data:((?:image|video)/[\w+.-]+);base64,([A-Za-z0-9+/=]+)'", extracted, page.decode())
    return {"index.html": text.encode(), **files}


def _code(text: str) -> str:
    """Escape a text for HTML, with `backticks` as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))
