"""A headless Chromium for tests of pages, driven by chromedriver over the WebDriver protocol (W3C, 2018)."""

import base64
import json
import shutil
import subprocess
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

NAMES, DRIVERS = ("chromium", "chromium-browser", "google-chrome"), ("chromedriver",)
#: no window, no sandbox (tests may run as root), WebGL by software, nothing that asks the net by itself
OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
    "--use-angle=swiftshader",
    "--hide-scrollbars",
)


def missing() -> str:
    """What is not there; empty where pages can be tested."""
    found = [
        name for name, names in (("chromium", NAMES), ("chromedriver", DRIVERS)) if not any(map(shutil.which, names))
    ]
    return f"pages are tested in a browser, and there is no {' and no '.join(found)}" if found else ""


needs_browser = pytest.mark.skipif(bool(missing()), reason=missing() or "there is one")


@dataclass(frozen=True)
class Browser:
    """One window."""

    url: str

    def ask(self, method: str, path: str, **body: Any) -> Any:
        """A command of the protocol; raises AssertionError with what the browser says of an error."""
        data = json.dumps(body).encode() if method == "POST" else None
        request = urllib.request.Request(f"{self.url}{path}", data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.loads(answer.read())["value"]
        except urllib.error.HTTPError as error:
            raise AssertionError(error.read().decode()) from None

    def open(self, page: Path | str) -> None:
        """Load a page from the disk or from an address, and forget what was logged before."""
        self.logs()
        self.ask("POST", "/url", url=page if isinstance(page, str) else page.resolve().as_uri())

    def run(self, script: str, *values: Any) -> Any:
        """What a script returns."""
        return self.ask("POST", "/execute/sync", script=script, args=list(values))

    def devtools(self, command: str, **values: Any) -> Any:
        """A command of Chromium's own protocol."""
        return self.ask("POST", "/goog/cdp/execute", cmd=command, params=values)

    def size(self, width: int, height: int, *, dark: bool = False) -> None:
        """The size of the page's window, and the reader's choice of colours."""
        self.devtools(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = [{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}]
        self.devtools("Emulation.setEmulatedMedia", features=scheme)

    def picture(self, *, whole: bool = False) -> bytes:
        """PNG of the window, or of the whole page."""
        return base64.b64decode(self.devtools("Page.captureScreenshot", captureBeyondViewport=whole)["data"])

    def printed(self) -> bytes:
        """The page as PDF."""
        return base64.b64decode(self.devtools("Page.printToPDF", printBackground=True)["data"])

    def logs(self) -> tuple[list[str], list[str]]:
        """Errors on the console, and addresses that were asked for over the net, since the last call."""
        console = self.ask("POST", "/se/log", type="browser")
        events = [json.loads(entry["message"])["message"] for entry in self.ask("POST", "/se/log", type="performance")]
        asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
        bad = [entry["message"] for entry in console if entry["level"] == "SEVERE"]
        return bad, [url for url in asked if not url.startswith(("data:", "blob:", "file:", "chrome:"))]

    def wait(self, script: str, seconds: float = 20.0) -> Any:
        """What a script returns once that is true; AssertionError when it never is."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.run(script)
            if found:
                return found
            time.sleep(0.1)
        raise AssertionError(f"never true: {script}")


@contextmanager
def browser() -> Iterator[Browser]:
    """A window, closed at the end with all that was started for it."""
    program = next(path for path in map(shutil.which, NAMES) if path)
    driver = next(path for path in map(shutil.which, DRIVERS) if path)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        process = subprocess.Popen([driver, "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        try:
            root = f"http://127.0.0.1:{_port(process)}"
            options = {"binary": program, "args": [*OPTIONS, f"--user-data-dir={folder}/profile"]}
            requested = {"goog:chromeOptions": options, "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
            made = Browser(root).ask("POST", "/session", capabilities={"alwaysMatch": requested})
            window = Browser(f"{root}/session/{made['sessionId']}")
            try:
                yield window
            finally:
                window.ask("DELETE", "")
        finally:
            process.terminate()
            process.communicate()


def _port(process: subprocess.Popen[str]) -> int:
    """The port on which the driver says that it listens."""
    assert process.stdout is not None
    for line in process.stdout:
        if "started successfully on port" in line:
            return int(line.rstrip(".\n").rpartition(" ")[2])
    raise AssertionError("chromedriver did not start")
