"""MkDocs hook: the notebooks of docs/notebooks as pages, executed where nbclient and ipykernel are installed."""

from __future__ import annotations

import html
import json
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

#: longest time for a cell [s]
PATIENCE = 600
#: page -> HTML of its outputs, which the page's Markdown names by their number
_OUTPUTS: dict[str, list[str]] = {}


def on_files(files: Any, config: Any, **_: Any) -> Any:
    """Add a page for each notebook."""
    from mkdocs.structure.files import File

    for path in sorted((Path(config["docs_dir"]) / "notebooks").glob("*.ipynb")):
        uri = f"notebooks/{path.stem}.md"
        text, _OUTPUTS[uri] = page(executed(path) if can_execute() else json.loads(path.read_text(encoding="utf-8")))
        files.append(File.generated(config, uri, content=f"{text}\n[The notebook]({path.name})\n"))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Let links to notebooks lead to their pages."""
    return re.sub(r"\]\((notebooks/\w+)\.ipynb\)", r"](\1.md)", markdown)


def on_page_content(content: str, page: Any, **_: Any) -> str:
    """Put the outputs of a notebook into its page."""
    for k, output in enumerate(_OUTPUTS.get(page.file.src_uri, ())):
        content = content.replace(f"<p>{_place(k)}</p>", output)
    return content


def can_execute() -> bool:
    """Return True where the programs that execute notebooks are installed, with Dask, which one of them uses."""
    return all(map(find_spec, ("nbclient", "ipykernel", "distributed")))


def executed(path: Path) -> dict[str, Any]:
    """Return a notebook with its outputs.  Raises CellExecutionError of nbclient, with the traceback of the cell."""
    import nbclient
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=PATIENCE, kernel_name="python3").execute()
    return dict(notebook)


def page(notebook: dict[str, Any]) -> tuple[str, list[str]]:
    """Return the Markdown of a notebook with a place for each output, and the outputs as HTML."""
    parts, outputs = list[str](), list[str]()
    for cell in notebook["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for shown in filter(None, map(_shown, cell.get("outputs", ()))):
            parts.append(_place(len(outputs)))
            outputs.append(f"<div class='output'>{shown}</div>")
    return "\n\n".join(parts) + "\n", outputs


def _place(number: int) -> str:
    return f"OUTPUT-{number}-OF-THE-NOTEBOOK"


def _shown(output: dict[str, Any]) -> str:
    """Return an output as HTML; nothing for messages on stderr and for progress that has gone."""
    data = output.get("data", {})
    if "text/html" in data:
        return "".join(data["text/html"])
    text = output.get("text", "") if output.get("name") == "stdout" else data.get("text/plain", "")
    return f"<pre>{html.escape(''.join(text))}</pre>" if text else ""
