"""Install the project into a virtual environment, by uv where that works and by pip where not; called by make.

    python tools/install.py .venv/bin/python .
    python tools/install.py .venv/bin/python ".[test]"

uv, itself installed from the registry by pip, fetches libraries side by side, in a third of pip's processor time.
Neither of the two compiles what it installs: Python compiles a module when it is first imported, and most never are.
Whoever has told pip of an index of their own, and uv of none, gets pip.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

UV_INDEXES = ("UV_DEFAULT_INDEX", "UV_INDEX_URL", "UV_INDEX")
Run = Callable[[Sequence[str]], "subprocess.CompletedProcess[str]"]


def _run(words: Sequence[str]) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(words, capture_output=True, text=True, check=False)


def pip_words(python: str, *what: str) -> tuple[str, ...]:
    """The command by which pip installs something, quietly and without compiling it."""
    return (python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-compile", *what)


def has_own_index(python: str, environment: Mapping[str, str], run: Run = _run) -> bool:
    """Whether pip was told of an index in place of the usual one, and uv of none."""
    if any(environment.get(name) for name in UV_INDEXES):
        return False
    lines = run((python, "-m", "pip", "config", "list")).stdout.splitlines()
    return any(line.split("=", 1)[0].endswith((".index-url", ".no-index")) for line in lines)


def install(python: str, project: str, environment: Mapping[str, str], run: Run = _run) -> int:
    """Install a project as editable; the status of the last command, 0 where all is well.

    Parameters
    ----------
    python : str
        Of the virtual environment.
    project : str
        Folder of the project, with the names of extras in brackets.
    environment : mapping
        Of this process.
    run : callable
        Runs a command.
    """
    if not has_own_index(python, environment, run) and run(pip_words(python, "uv")).returncode == 0:
        uv = str(Path(python).with_name("uv"))
        if run((uv, "pip", "install", "--quiet", "--python", python, "--editable", project)).returncode == 0:
            return 0
        print("uv could not install it; pip is at it, which takes longer.", flush=True)
    done = run(pip_words(python, "--editable", project))
    print(done.stdout + done.stderr, end="", file=sys.stderr)
    return done.returncode


if __name__ == "__main__":
    sys.exit(install(sys.argv[1], sys.argv[2], os.environ))
