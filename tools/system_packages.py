"""Install the system libraries that tests need on a bare Linux machine; called by make, and does nothing elsewhere.

Only the tests need any: pymeshlab OpenGL's loader (libGL), which wheels do not carry; the Arduino sketches the AVR
compiler; the second opinion's fast variant LLVM; and the report a browser without a window. Tests are skipped where one
of the last three is missing.
"""

import ctypes.util
import os
import shutil
import subprocess
import sys

OPENGL = ("libgl1", "libopengl0")  # Debian's names
FIRMWARE = ("gcc-avr", "avr-libc", "arduino-core-avr")
LLVM = ("libllvm19",)
BROWSER = ("chromium-headless-shell",)
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
LLVM_VERSIONS = range(17, 31)  # that Mitsuba 3.9 takes


def missing() -> list[tuple[str, ...]]:
    """Groups of Debian packages whose content is not on this machine."""
    groups: list[tuple[str, ...]] = []
    if ctypes.util.find_library("GL") is None:
        groups.append(OPENGL)
    if shutil.which("avr-g++") is None:
        groups.append(FIRMWARE)
    if not any(ctypes.util.find_library(f"LLVM-{version}") for version in LLVM_VERSIONS):
        groups.append(LLVM)
    if not any(shutil.which(name) for name in BROWSERS):
        groups.append(BROWSER)
    return groups


def main() -> None:
    """Install what is missing where that can be done; say what to do where it cannot."""
    if not sys.platform.startswith("linux"):
        return
    wanted = missing()
    if not wanted:
        return
    if shutil.which("apt-get") is None or os.geteuid() != 0:
        names = " ".join(name for group in wanted for name in group)
        print(f"Please install with your package manager (Debian's names): {names}", file=sys.stderr)
        return
    subprocess.run(["apt-get", "update", "-qq"], check=False)
    for group in wanted:
        done = subprocess.run(["apt-get", "install", "-y", "-qq", "--no-install-recommends", *group], check=False)
        if done.returncode != 0:
            print(f"Could not install {' '.join(group)}; some parts will not run.", file=sys.stderr)


if __name__ == "__main__":
    main()
