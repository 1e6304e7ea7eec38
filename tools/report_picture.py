"""Take the picture of a report's 3D view that README and docs show: python -m tools.report_picture REPORT OUT.png.

Needs the `test` extra and a Chromium; docs/pictures/report-room.png is of `lidarspectra demo`.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from tools.system_packages import BROWSERS

WIDTH_PX, HEIGHT_PX = 1400, 900
SHOWN_POINT = "90"  # in the middle of the room
SOFTWARE_WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed


def main(report: Path, out: Path) -> None:
    """Open the report and save its 3D view."""
    with sync_playwright() as driver:
        found = next((path for path in map(shutil.which, BROWSERS) if path), driver.chromium.executable_path)
        browser = driver.chromium.launch(executable_path=found, args=SOFTWARE_WEBGL)
        page = browser.new_page(viewport={"width": WIDTH_PX, "height": HEIGHT_PX}, color_scheme="light")
        page.goto(report.resolve().as_uri())
        page.locator("#room-point").fill(SHOWN_POINT)
        page.locator("#room-point").blur()
        page.locator("#room").screenshot(path=out)
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
