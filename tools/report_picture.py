"""Take the pictures of a report's first screen that README and docs show: python -m tools.report_picture REPORT FOLDER.

Needs the `test` extra and a Chromium; those in docs/pictures are of `lidarspectra demo`.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from tools.system_packages import BROWSERS

SCREENS = {  # file: width and height [px], colours, and the link's fragment
    "report-room.png": ((1400, 900), "light", ""),
    "report-lamps.png": (
        (1400, 900),
        "dark",
        "#name=evening&lamp=panel+west&spectrum=LED-B1&dim=0.4&lamp=panel+east&dim=0",
    ),
    "report-phone.png": ((420, 800), "light", ""),
}
SHOWN_POINT = "90"  # in the middle of the room
SOFTWARE_WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed


def main(report: Path, folder: Path) -> None:
    """Open the report on every screen and save what is seen."""
    with sync_playwright() as driver:
        found = next((path for path in map(shutil.which, BROWSERS) if path), driver.chromium.executable_path)
        browser = driver.chromium.launch(executable_path=found, args=SOFTWARE_WEBGL)
        for name, ((width, height), scheme, fragment) in SCREENS.items():
            page = browser.new_page(viewport={"width": width, "height": height}, color_scheme=scheme)  # type: ignore[arg-type]
            page.goto(report.resolve().as_uri() + fragment)
            page.locator("#room-point").fill(SHOWN_POINT)
            page.locator("#room-point").blur()
            page.evaluate("window.scrollTo(0, 0)")
            page.screenshot(path=folder / name)
            page.close()
        browser.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
