"""The live page in Chromium without a window, from the real server: numbers, map, alarm and loss of the server."""

import threading
from contextlib import contextmanager

import numpy as np
import pytest

from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel
from lidarspectra.mapping.present_light.now import LitRoom, PresentLight
from lidarspectra.mapping.report.live_page import LiveView, trend_json
from lidarspectra.mapping.report.room_view import room_view_data, shown_points
from lidarspectra.workflow.live.board import Board
from lidarspectra.workflow.live.server import LiveServer

PATIENCE_MS = 60_000  # a loaded machine without a graphics card draws slowly
HOSTILE = "<img src=x onerror=document.title='bad'>"


@pytest.fixture(scope="module")
def live(make_transport, lamps):
    """A room of two lamps and three lux sensors, and its page."""
    light = spectral_map(make_transport(points=16))
    sensors = np.array([[200.0, 20.0], [100.0, 100.0], [20.0, 200.0]])
    map_light = np.stack([np.linspace(200, 10, 16), np.linspace(10, 200, 16)], axis=1)
    room = LitRoom(
        lamps=("west", HOSTILE),
        sensors=("a", HOSTILE, "c"),
        quantities=("illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s"),
        numbers=(("a", "lux"), (HOSTILE, "lux"), ("c", "lux")),
        model=SensorModel(light=sensors, sensor=np.arange(3), reading_sd=np.full(3, 0.03)),
        knowledge=LampKnowledge(flux_sd=np.full(2, 0.1), full=np.ones(2), is_daylight=np.zeros(2, dtype=np.bool_)),
        map_light=np.stack([map_light, 0.8 * map_light, map_light / 70]),
        sensor_light=np.stack([sensors, 0.8 * sensors, sensors / 70]),
        counted=np.ones(16, dtype=np.bool_),
    )
    places = np.array([[0.5, 0.5, 1.0], [1.5, 1.5, 1.0], [2.5, 2.5, 1.0]])
    view = LiveView(title=HOSTILE, room=room, places=places, shown=shown_points(16))
    return view, view.page(room_view_data(light, None, (), np.zeros(0), lamps))


@contextmanager
def serving(page, present):
    board = Board()
    server = LiveServer(page, board, lambda: trend_json(present.trend, 3))
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
    thread.start()
    try:
        yield server, board
    finally:
        board.close()
        server.shutdown()
        server.server_close()
        thread.join(30.0)


def test_the_page_shows_the_light_of_now_an_alarm_and_when_the_server_is_gone(browser, live) -> None:
    view, text = live
    present = PresentLight(view.room, patience=1)
    window = browser.new_context(viewport={"width": 1400, "height": 900})
    window.set_default_timeout(PATIENCE_MS)
    page = window.new_page()
    wrong, asked = [], []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))

    def read(factor: float, time_s: float) -> str:
        for name, value in zip(view.room.sensors, view.room.model.light @ [1.0, 0.5], strict=True):
            present.take(name, {"lux": float(value) * (factor if name == "c" else 1.0)}, time_s)
        return view.message(present.answer(time_s), present.last_s)

    with serving(text, present) as (server, board):
        page.goto(server.address)
        page.get_by_text("Waiting for the first reading.").wait_for()
        board.show(read(1.0, 1000.0))
        page.locator("#live-status.on").wait_for()
        assert "157" in page.locator("#live-means").inner_text()  # mean of 105 x 1.5
        lamps = page.locator("#live-lamps li")
        assert lamps.count() == 2
        assert HOSTILE in lamps.nth(1).inner_text()  # as text
        assert page.locator("#live-sensors tr").nth(0).locator("td").nth(1).inner_text() == "210 lx"
        assert page.locator("#live-alarm").is_hidden()
        page.locator("#live-trend svg").wait_for()  # drawn after the numbers
        before = page.locator("#room-canvas").screenshot()
        for lamp, level in (("west", 1.0), (HOSTILE, 0.5)):
            present.take(lamp, {"state": level}, 1001.0)
        board.show(read(0.05, 1001.0))
        page.locator("#live-alarm").wait_for()
        assert "Sensor 'c' reads 0.05 times" in page.locator("#live-alarm").inner_text()
        assert "switch: 50 %" in page.locator("#live-lamps").inner_text()
        page.locator("#live-quantity").select_option("1")
        assert "melanopic EDI" in page.locator("#live-legend").inner_text()
        assert page.locator("#room-canvas").screenshot() != before  # the sensor in doubt is red
        board.show(read(1.0, 1002.0))
        page.locator("#live-alarm").wait_for(state="hidden")
    page.get_by_text("The server is gone").wait_for()
    assert wrong == []
    assert page.title().startswith("<img")
    assert all(url.startswith(server.address) for url in asked)
    window.close()


def test_the_page_fits_a_phone(browser, live) -> None:
    view, text = live
    present = PresentLight(view.room)
    window = browser.new_context(viewport={"width": 420, "height": 800})
    window.set_default_timeout(PATIENCE_MS)
    page = window.new_page()
    with serving(text, present) as (server, board):
        board.show(view.message(present.answer(1000.0), None))
        page.goto(server.address)
        page.get_by_text("No reading yet").wait_for()
        assert page.evaluate("document.documentElement.scrollWidth") <= 420
    window.close()
