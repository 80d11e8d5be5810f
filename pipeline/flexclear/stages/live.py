"""A page that follows a scene's file: served on the loopback interface, and made again when the file is saved."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socketserver import TCPServer
from threading import Thread
from typing import Any, Protocol

from flexclear.post.pages import figures_of, findings, live_page, media
from flexclear.scene.load import files_read
from flexclear.scene.schema import Scene
from flexclear.stages import scenes, show
from flexclear.stages.graph import Graph
from flexclear.stages.notebook import DRAWN
from flexclear.stages.workplace import Workplace
from flexclear.system.errors import FlexclearError, InputError
from flexclear.workflow import stopping

#: the only address that serves, and interval at which the files are looked at [s]
ADDRESS, TICK = "127.0.0.1", 0.25
#: what a page may load: what is inside of it, and the next version of itself
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; media-src data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class Findings(Protocol):
    """What `commands.check.examined` returns."""

    errors: list[FlexclearError]
    notes: list[str]

    def records(self) -> list[dict[str, Any]]:
        """Return errors and warnings as tables: severity, file, line, place, problem, remedy."""


#: keys of a record without a place in a file
EMPTY = ("file", "line", "remedy")
#: examines a scene: its name, its settings, and the error that refuses its drawn start, or None
Examine = Callable[[str, Sequence[str], InputError | None], Findings]


class Server(ThreadingHTTPServer):
    """Serves one page, ``/``, and its number, ``/version``, to readers on this machine."""

    daemon_threads = True
    version = 0

    def __init__(self) -> None:
        super().__init__((ADDRESS, 0), _Handler)
        self.publish("flexclear", (), "<p>The scene is being read.</p>")

    def server_bind(self) -> None:
        """Take a free port; the name of this machine, which the standard library looks up here, is not needed."""
        TCPServer.server_bind(self)
        self.server_name, self.server_port = ADDRESS, self.server_address[1]

    def publish(self, title: str, views: Sequence[str], beside: str) -> None:
        """Replace the page."""
        self.page = live_page(title, views, beside, self.version + 1)
        self.version += 1

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore readers that have gone, and what they sent."""


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = 10.0  #: of a connection [s]
    server_version, sys_version = "flexclear", ""

    def do_GET(self) -> None:
        # a page from elsewhere whose name leads to this machine would read along
        hosts = {f"{name}:{self.server.server_port}" for name in (ADDRESS, "localhost")}
        if self.headers.get_all("Host") not in [[host] for host in hosts]:
            self.send_error(403)
            return
        answers = {"/": ("text/html", self.server.page), "/version": ("text/plain", b"%d" % self.server.version)}
        if self.path not in answers:
            self.send_error(404)
            return
        kind, content = answers[self.path]
        self.send_response(200)
        for name, value in {
            "Content-Type": f"{kind}; charset=utf-8",
            "Content-Length": str(len(content)),
            "Cache-Control": "no-store",
            "Content-Security-Policy": POLICY,
            "Cross-Origin-Resource-Policy": "same-origin",
            "X-Content-Type-Options": "nosniff",
        }.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        pass


@contextmanager
def served() -> Iterator[Server]:
    """Serve in a thread while this context lasts."""
    with Server() as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def follow(name: str, settings: Sequence[str], examine: Examine, workplace: Workplace | None = None) -> None:
    """Serve the start pose of a scene with all errors beside it, drawn again when one of its files is saved.

    Ends by Ctrl-C only.  A pose that cannot be drawn leaves the last one.  workplace: where a scene without error is
    also run, for its film and watched curves; None: it is not run.
    """
    path, title, views, film = scenes.find_scene(name), name, list[str](), list[str]()
    with served() as server:
        print(f"http://{ADDRESS}:{server.server_port}/ follows {path} until Ctrl-C", flush=True)
        while True:
            saved = Saved(files_read(path))
            refused, note = None, []
            try:
                scene = scenes.loaded(name, settings)
                view, refused = show.drawn(scene)
                title, views = show.title_of(scene), [show.figure(scene, view)]
            except FlexclearError:  # among those that `examine` returns
                note = ["The view is that of the last version that can be drawn." if views else "Nothing can be drawn."]
            found = examine(name, settings, refused)
            records, notes = found.records(), [*note, *found.notes]
            sound = workplace is not None and not found.errors
            now = ["It runs."] if sound else ["Film and curves are those of the last version that ran."] if film else []
            server.publish(title, [*views, *film], findings(_count(records, path), _quoted(records), [*notes, *now]))
            if workplace is not None and sound:
                try:
                    with stopping.when(saved.again, "a file of the scene was saved"):
                        film, now = _film(scene, workplace), []
                except FlexclearError as error:
                    now = ["The film is that of the last version that ran."] if film else []
                    records.append({"severity": "error", "problem": str(error), "place": "", **dict.fromkeys(EMPTY)})
                if not saved.again():
                    beside = findings(_count(records, path), _quoted(records), [*notes, *now])
                    server.publish(title, [*views, *film], beside)
            while not saved.again():
                time.sleep(TICK)


def _film(scene: Scene, workplace: Workplace) -> list[str]:
    """Run a scene, and return its motion as a view to turn, and its watched quantities."""
    from flexclear.post.overview.figures import watched_curves

    graph = Graph(scene, shown=False)
    drawn, run = workplace.made(graph.picture("motion", "html"), graph.simulate, jobs=1)
    curves = watched_curves(run.dataset(), scene.watched()[:DRAWN])
    views = [figures_of(drawn.text(name)) for name in drawn.record.files]
    return views if curves is None else [*views, media("watched.png", curves, "Watched quantities")]


class Saved:
    """Files, and whether one of them was saved, replaced or removed since this object was made."""

    def __init__(self, files: Sequence[Path]) -> None:
        self.files, self.stamps = files, _stamps(files)
        self.asked, self.changed = time.monotonic(), False

    def again(self) -> bool:
        """Return True when one was; looks at the disk at most once in TICK."""
        if not self.changed and time.monotonic() - self.asked >= TICK:
            self.asked, self.changed = time.monotonic(), _stamps(self.files) != self.stamps
        return self.changed


def _stamps(files: Iterable[Path]) -> list[tuple[int, ...] | None]:
    """Return what changes when one of the files is saved, replaced or removed."""
    stamps = list[tuple[int, ...] | None]()
    for file in files:
        try:
            status = file.stat()
            stamps.append((status.st_mtime_ns, status.st_size, status.st_ino))
        except (OSError, ValueError):
            stamps.append(None)
    return stamps


def _count(records: Sequence[Mapping[str, Any]], path: Path) -> str:
    kinds = [record["severity"] for record in records]
    counts = [f"{kinds.count(kind) or 'no'} {kind}{'s' * (kinds.count(kind) > 1)}" for kind in ("error", "warning")]
    return f"{path.name}: {', '.join(counts)}"


def _quoted(records: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the records with the text of their line, whose file and number their place need not repeat."""
    for record in records:
        text, place = "", record["place"]
        if record["line"]:
            place, file = place[place.find("[") :] if "[" in place else "", Path(record["file"]).resolve()
            with suppress(OSError, ValueError, IndexError):
                if file.suffix == ".toml":  # no other file that a scene names is quoted
                    text = file.read_text(encoding="utf-8-sig").splitlines()[record["line"] - 1].strip()
        yield {**record, "place": place, "text": text}
