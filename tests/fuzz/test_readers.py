"""Whatever is in a file, its reader gives a result or an error of ours: a first share of the campaign (`make fuzz`).

The whole campaign, its bounds and how a case is tried again stand in `campaign.py`.
"""

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGN = Path(__file__).with_name("campaign.py")
CASES = 25  # [1] of each reader; the first are the valid files

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="memory is bounded by POSIX's limits"),
]


def reader_names() -> list[str]:
    """Names of the readers, without loading their libraries."""
    tree = ast.parse(CAMPAIGN.with_name("readers.py").read_text(encoding="utf-8"))
    calls = (node for node in ast.walk(tree) if isinstance(node, ast.Call))
    return [
        keyword.value.value
        for call in calls
        if isinstance(call.func, ast.Name) and call.func.id == "Reader"
        for keyword in call.keywords
        if keyword.arg == "name" and isinstance(keyword.value, ast.Constant)
    ]


@pytest.fixture(scope="module")
def outcomes() -> dict[str, dict[str, object]]:
    """What became of every reader, in one child process with bounds."""
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    words = [sys.executable, str(CAMPAIGN), "--without", "room", "--cases", str(CASES), "--together", "--json"]
    run = subprocess.run(words, capture_output=True, text=True, encoding="utf-8", check=False)
    assert run.returncode == 0, run.stderr[-4000:]
    found = [json.loads(line) for line in run.stdout.splitlines()]
    return {outcome["name"]: outcome for outcome in found}


@pytest.mark.parametrize("name", [name for name in reader_names() if name != "room"])  # `test_rooms` has those
def test_a_damaged_file_gives_a_result_or_our_error_and_nothing_else_happens(
    outcomes: dict[str, dict[str, object]], name: str
) -> None:
    assert outcomes[name]["faults"] == []
    assert outcomes[name]["cases"] == CASES
