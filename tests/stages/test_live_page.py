"""A page that follows a file: who may read it, what it shows after each save, how it ends."""

import signal
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from flexclear.commands.__main__ import main
from flexclear.scene.load import files_read
from flexclear.stages import live as live_page
from flexclear.system.errors import INTERRUPTED
from tests.browser import Browser, browser, needs_browser
from tests.stages.conftest import interruptible

PENDULUM = """
title = "A pendulum"
time.end = "0.2 s"
view.watch = ["bob.position.x"]

[body.ground]
type = "ground"
frames.O = {}

[body.bob]
type = "rigid"
mass = "1 kg"
com = ["-1 m", 0.0, 0.0]
inertia = [0.0, 0.0, 0.0]
pose = {}
frames.hinge = {}

[joint.hinge]
type = "revolute"
between = ["ground.O", "bob.hinge"]

[load.gravity]
type = "gravity"
acceleration = [0.0, -9.81, 0.0]
"""

#: time [s] of a motion whose run takes minutes
LONG = 1e7


@dataclass
class Live:
    """A command that serves a page, its address, and the folder of its scene `my.toml`, which extends `base.toml`."""

    process: subprocess.Popen[str]
    url: str
    folder: Path

    def write(self, base: str) -> None:
        (self.folder / "base.toml").write_text(base)


@contextmanager
def live(folder: Path, *options: str) -> Iterator[Live]:
    (folder / "my.toml").write_text('extends = "base.toml"\n')
    (folder / "base.toml").write_text(PENDULUM)
    command = [sys.executable, "-m", "flexclear", "show", "my.toml", "--watch", *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(command, cwd=folder, preexec_fn=interruptible, **pipes)
    try:
        assert process.stdout is not None
        yield Live(process, process.stdout.readline().partition(" ")[0], folder)
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with live(tmp_path_factory.mktemp("live")) as found:
        yield found


@pytest.fixture(scope="module")
def window() -> Iterator[Browser]:
    with browser() as found:
        yield found


def status(url: str, method: str = "GET", **headers: str) -> int:
    """The code of the answer to a request."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers, method=method), timeout=60) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_only_this_machine_reads_and_only_the_page(served: Live):
    listening = [c for c in psutil.Process(served.process.pid).net_connections() if c.status == psutil.CONN_LISTEN]
    assert [c.laddr.ip for c in listening] == ["127.0.0.1"]
    port = listening[0].laddr.port
    assert served.url == f"http://127.0.0.1:{port}/"
    assert status(served.url) == status(served.url + "version", Host=f"localhost:{port}") == 200
    for host in ("example.org", f"example.org:{port}", "127.0.0.1", "127.0.0.1:1"):  # as by a name that leads here
        assert status(served.url, Host=host) == 403
    for path in ("my.toml", "../my.toml", "/etc/passwd", "%2e%2e/my.toml", "?", "version/"):
        assert status(served.url + path) == 404
    assert status(served.url, "POST") == 501
    with urllib.request.urlopen(served.url, timeout=60) as page:
        assert "default-src 'none'" in page.headers["Content-Security-Policy"]


def test_ctrl_c_ends_it_with_the_exit_code_of_all_commands(tmp_path: Path):
    with live(tmp_path) as one:
        one.process.send_signal(signal.SIGINT)
        _, said = one.process.communicate(timeout=60)
        assert one.process.returncode == INTERRUPTED
        assert said.strip() == "flexclear: interrupted; finished results are stored"


def test_it_follows_one_scene(capsys: pytest.CaptureFixture[str]):
    assert main(["show", "--watch", "sps4/csj", "sps4/ideal"]) == 2
    assert "--watch: follows one scene, not 2" in capsys.readouterr().err


def test_followed_are_the_files_that_a_scene_extends_and_those_that_it_names(tmp_path: Path, root: Path):
    """Also while one of them cannot be read, or extends itself."""
    rod = root / "meshes/actuated_rod.toml"
    first, second = tmp_path / "first.toml", tmp_path / "second.toml"
    first.write_text('extends = "second.toml"')
    second.write_text(f"{PENDULUM}\n[body.rod]\ntype = 'flexible'\nmesh = '{rod.as_posix()}'\n")
    assert files_read(first) == [first, second, rod]
    second.write_text("title = 'no")
    assert files_read(first) == [first, second]
    second.write_text('extends = "first.toml"')
    assert files_read(first) == [first, second]
    second.unlink()
    assert files_read(first) == [first, second]


def test_only_lines_of_toml_files_are_quoted(tmp_path: Path):
    """A scene may extend any file that can be read as TOML, such as one with passwords."""
    (secret := tmp_path / "secret.env").write_text("[body.rod]\nmass = 'a password'\n")
    (named := tmp_path / "named.toml").symlink_to(secret)
    (own := tmp_path / "own.toml").write_text(secret.read_text())
    record = {"line": 2, "place": "x.toml [body.rod.mass]"}
    quoted = live_page._quoted([{**record, "file": str(file)} for file in (secret, named, own)])
    assert [one["text"] for one in quoted] == ["", "", "mass = 'a password'"]


FOUND = "return document.querySelector('.findings').innerText"


@needs_browser
def test_the_page_follows_the_file_with_all_errors_by_line(served: Live, window: Browser):
    """A camera that was turned stays, and a scene that cannot be drawn leaves the last view."""
    window.size(1280, 900)
    window.open(served.url)
    window.wait("return !!document.querySelector('.viewer')?.viewer")
    assert window.wait(FOUND).startswith("my.toml: no error")
    eye = "return document.querySelector('.viewer').viewer.eye"
    window.run("document.querySelector('.viewer').viewer.turn(0.5, 0.2)")
    turned, labels = window.run(eye), "return document.querySelector('.viewer-names').textContent"
    served.write(PENDULUM.replace("joint.hinge]", "joint.axle]").replace("A pendulum", "Another <i>"))
    window.wait("return document.title.startsWith('Another')")
    assert "axle" in window.run(labels)
    assert window.run("return document.querySelector('h1').textContent") == "Another <i>"
    assert window.run(eye) == turned
    served.write(PENDULUM.replace("1 kg", "1 s").replace("ground.O", "ground.P"))
    window.wait(FOUND.replace("return", "return /2 errors/.test(") + ")")
    found, text = window.run(FOUND), PENDULUM.splitlines()
    mass, between = (k for k, line in enumerate(text, 1) if "1 kg" in line or "ground.O" in line)
    first, second = (f"error, base.toml line {line} [" for line in (mass, between))
    assert found.index(first) < found.index('mass = "1 s"') < found.index(second) < found.index("ground.P")
    assert "last version" in found
    assert "axle" in window.run(labels)
    served.write(PENDULUM + "[joint\n")
    window.wait(FOUND.replace("return", f"return /base.toml line {len(text) + 1} /.test(") + ")")
    served.write(PENDULUM)
    window.wait(FOUND.replace("return", "return /no error/.test(") + ")")
    assert "hinge" in window.run(labels)
    errors, asked = window.logs()
    assert errors == []
    assert all(url.startswith(served.url) for url in asked)


@needs_browser
def test_film_and_curves_follow_the_file(tmp_path: Path, window: Browser):
    """A run of a minute and more is stopped by the next save; a scene with errors leaves the film; its time stays."""
    films = "[...document.querySelectorAll('.viewer')].map((v) => v.viewer).filter((v) => v.data.times.length > 1)"
    curves = "return [...document.images].filter((i) => i.complete && i.naturalWidth > 100).length"
    end = f"return {films}[0].data.times.at(-1)"
    with live(tmp_path, "--run") as one:
        window.size(1280, 900)
        window.open(one.url)
        window.wait(f"return {films}.length === 1", 120.0)
        assert window.run(end) == pytest.approx(0.2)
        assert window.wait(curves) == 1
        one.write(PENDULUM.replace('"0.2 s"', f'"{LONG:g} s"\noutput.interval = "1000 s"'))
        window.wait(FOUND.replace("return", "return /It runs/.test(") + ")")
        one.write(PENDULUM.replace('"0.2 s"', '"0.1 s"'))
        window.wait(f"return {films}[0].data.times.at(-1) < 0.15", 120.0)
        assert not window.run(FOUND.replace("return", "return /It runs/.test(") + ")")
        window.run(f"{films}[0].zoom(2); const t = document.querySelector('[data-part=time]'); t.value = 9;"
                   "t.dispatchEvent(new Event('input'))")  # fmt: skip
        one.write(PENDULUM.replace("1 kg", "1 s"))
        window.wait(FOUND.replace("return", "return /1 error/.test(") + ")")
        assert "Film and curves are those of the last version that ran." in window.run(FOUND)
        assert window.run(f"return {films}[0].frame") == 9
        assert window.logs()[0] == []
        one.process.send_signal(signal.SIGINT)
        assert one.process.wait(60) == INTERRUPTED


def test_a_film_needs_the_page(capsys: pytest.CaptureFixture[str]):
    assert main(["show", "--run", "sps4/csj"]) == 2
    assert "hint: add --watch" in capsys.readouterr().err
