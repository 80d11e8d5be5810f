"""Pages in a browser: no errors, no requests, everything loads, tables sort, films play, views turn, phones fit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flexclear.post.pages import Part, downloads, media, page, prose, viewer
from flexclear.post.plotting.table import Table, as_html
from flexclear.post.render import film_speed, player
from flexclear.post.render.mechanism import mechanism
from flexclear.post.render.pictures import png
from tests.browser import Browser, browser, needs_browser
from tests.paper import synthetic

pytestmark = needs_browser
PHONE, DESK = (390, 844), (1280, 900)
#: begins or pauses the motion of a view
PLAY = "document.querySelectorAll('[data-part=play]')[arguments[0]].click()"


@pytest.fixture(scope="module")
def window() -> Iterator[Browser]:
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with one of everything: film, picture, views of a motion and of modes, tables, files to take away."""
    run, bundle = synthetic.run("sps4/far_csj_cb", clearance=True, modes=7), synthetic.bundle()
    shades = [np.full((64, 96, 3), 40 * k, dtype=np.uint8) for k in range(6)]
    suffix, film = film_speed.write(iter(shades * 4), 24)
    rows = (("b", "2.5 mm", "10.0 ± 0.1 N"), ("a", "900 µm", "9.0 ± 0.1 N"), ("c", "1.2 m", "–"))
    table = Table("Numbers", ("name of a quantity that is long", "length", "force"), rows)
    parts = [
        Part("film", "Film", media(f"film.{suffix}", film, "A film", "Grey that becomes brighter")),
        Part("picture", "Picture", media("grey.png", png(shades[2]), "A picture", "Grey")),
        Part(
            "views",
            "Views",
            viewer(player.motion(mechanism(run, {"rod1": bundle}), 24), "Motion")
            + viewer(player.modes(bundle), "Modes", play=True),
        ),
        Part("tables", "Tables", as_html(table) + prose(("v", "a"), [("body.rod1.modes", "assumed: " + "long " * 60)])),
        Part("downloads", "Files", downloads({"scene.toml": b"title = 'x'"})),
    ]
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_bytes(page("A report", "What it is about", parts, "<ul><li>The answer</li></ul>"))
    return path


def opened(window: Browser, path: Path, size: tuple[int, int]) -> Browser:
    """The page with its views drawn; that of modes, which moves, is paused: a moving one keeps the browser busy."""
    window.size(*size)
    window.open(path)
    window.wait("return [...document.querySelectorAll('.viewer')].every((v) => v.viewer)")
    assert window.run("return document.querySelectorAll('[data-part=play]')[1].textContent") == "Pause"
    window.run(PLAY, 1)
    return window


@pytest.fixture(scope="module")
def desk(window: Browser, report: Path) -> Browser:
    """The page in a large window, loaded once: each test looks at or moves another part of it."""
    return opened(window, report, DESK)


def test_a_page_has_no_errors_asks_for_nothing_and_all_of_it_loads(desk: Browser):
    assert desk.run("return [...document.images].filter((i) => !i.complete || !i.naturalWidth).length") == 0
    errors, asked = desk.logs()
    assert errors == []
    assert asked == []
    assert desk.run("return document.title") == "A report"


def test_tables_sort_by_size_whatever_the_unit(desk: Browser):
    read = (
        "return [...document.querySelector('table.sorts').tBodies[0].rows].map((r) => r.cells[0].textContent).join('')"
    )
    click = "document.querySelector('table.sorts').tHead.rows[0].cells[arguments[0]].querySelector('button').click()"
    desk.run(click, 1)
    assert desk.run(read) == "abc"  # 900 µm, 2.5 mm, 1.2 m
    desk.run(click, 1)
    assert desk.run(read) == "cba"
    desk.run(click, 2)
    assert desk.run(read) == "abc"  # 9, 10, nothing
    head = "return document.querySelector('table.sorts').tHead.rows[0].cells[2].getAttribute('aria-sort')"
    assert desk.run(head) == "ascending"


def test_a_film_plays(desk: Browser):
    if not desk.run("return !!document.createElement('video').canPlayType('video/mp4; codecs=\"avc1.42E01E\"')"):
        pytest.skip("this browser has no H.264")
    desk.wait("return document.querySelector('video').readyState >= 2")
    desk.run("const v = document.querySelector('video'); v.muted = true; v.play();")
    assert desk.wait("return document.querySelector('video').currentTime > 0.1")


PIXELS = (
    "const c = document.querySelectorAll('.viewer canvas')[arguments[0]]; const d = document.createElement('canvas');"
    "d.width = 120; d.height = 80; const x = d.getContext('2d'); x.drawImage(c, 0, 0, 120, 80);"
    "return Array.from(x.getImageData(0, 0, 120, 80).data)"
)


def test_a_view_turns_by_mouse_and_keys_and_comes_back(desk: Browser):
    first = np.array(desk.run(PIXELS, 0))
    assert np.ptp(first.reshape(-1, 4), axis=0).max() > 50  # something is drawn
    press = (
        "const c = document.querySelectorAll('.viewer canvas')[0]; for (let k = 0; k < 5; k++)"
        "c.dispatchEvent(new KeyboardEvent('keydown', { key: arguments[0] }))"
    )
    desk.run(press, "ArrowLeft")
    turned = np.array(desk.run(PIXELS, 0))
    assert np.abs(turned - first).max() > 50
    desk.run("document.querySelectorAll('[data-part=home]')[0].click()")
    np.testing.assert_allclose(desk.run(PIXELS, 0), first, atol=2)  # of 255: the canvas is drawn anew
    drag = (
        "const c = document.querySelectorAll('.viewer canvas')[0]; c.setPointerCapture = () => {};"
        "for (const [kind, x] of [['down', 200], ['move', 260], ['up', 260]])"
        "c.dispatchEvent(new PointerEvent('pointer' + kind, { pointerId: 1, clientX: x, clientY: 100 }))"
    )
    desk.run(drag)
    assert np.abs(np.array(desk.run(PIXELS, 0)) - first).max() > 50


def test_a_motion_runs_and_every_mode_can_be_chosen(desk: Browser):
    state = "return document.querySelectorAll('.viewer-state')[arguments[0]].textContent"
    assert desk.run(state, 0).startswith("t = 0.00 ms")
    desk.run(PLAY, 0)
    desk.wait("return !document.querySelectorAll('.viewer-state')[0].textContent.startsWith('t = 0.00 ms')")
    desk.run(PLAY, 0)
    assert desk.run("return document.querySelector('[data-part=shape]').options.length") == 7
    desk.run("const s = document.querySelector('[data-part=shape]'); s.value = 6; s.dispatchEvent(new Event('change'))")
    assert desk.run(state, 1).startswith("mode 7")
    assert desk.logs()[0] == []


def test_a_page_has_texts_for_screen_readers(desk: Browser):
    assert desk.run("return [...document.images].filter((i) => !i.alt).length") == 0
    assert desk.run("return [...document.querySelectorAll('video, canvas')].filter((e) => !e.ariaLabel).length") == 0
    assert desk.run("return [...document.querySelectorAll('h1, h2')].map((h) => h.tagName).join('')") == "H1" + 5 * "H2"
    unnamed = "return [...document.querySelectorAll('input, select')].filter((e) => !e.closest('label')).length"
    assert desk.run(unnamed) == 0
    assert desk.run("return document.documentElement.lang") == "en"


def test_a_page_prints(desk: Browser):
    assert desk.printed().startswith(b"%PDF")
    rule = (
        "return [...document.styleSheets].flatMap((s) => [...s.cssRules]).filter((r) => r.media && "
        "r.media.mediaText === 'print').some((r) => r.cssText.includes('break-inside: avoid'))"
    )
    assert desk.run(rule)


def test_a_page_fits_a_phone_and_can_be_read_in_the_dark(window: Browser, report: Path):
    opened(window, report, PHONE)
    for dark in (False, True):
        window.size(*PHONE, dark=dark)
        assert window.run("return document.documentElement.scrollWidth") <= PHONE[0]
        ink, back = window.run(
            "const light = (t) => { const [r, g, b] = t.match(/\\d+/g).map((v) => { v /= 255; "
            "return v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4; }); "
            "return 0.2126*r + 0.7152*g + 0.0722*b; };"
            "const s = getComputedStyle(document.body); return [light(s.color), light(s.backgroundColor)];"
        )
        # WCAG 2.2, 1.4.3: 4.5 to 1 at least
        assert (max(ink, back) + 0.05) / (min(ink, back) + 0.05) > 4.5
        assert (ink > back) == dark
