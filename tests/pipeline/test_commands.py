"""Every command that the pages and the program's own words name exists, with those options and arguments."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from lidarspectra.cli.app import app
from lidarspectra.cli.relight import parse_orders

PROGRAM = "lidarspectra"
PROJECT = Path(__file__).resolve().parents[2]
PAGES = [PROJECT / "README.md", PROJECT / "CONTRIBUTING.md", *sorted((PROJECT / "docs").rglob("*.md"))]
ROOT: Any = typer.main.get_command(app)


def examples(page: str) -> Iterator[str]:
    """Whole commands: indented or fenced lines, joined where they end in a backslash."""
    for line in page.replace("\\\n", " ").splitlines():
        words = line.strip().removeprefix("$ ")
        if words.startswith(f"{PROGRAM} ") and (line.startswith(("    ", "\t")) or words == line):
            yield words


def mentions(page: str) -> list[str]:
    """Commands in running text, often without their arguments."""
    return re.findall(rf"`({PROGRAM} [a-z][^`\n]*)`", page)


def advice(source: str) -> list[str]:
    """Commands that the program's own messages name."""
    return re.findall(rf"'({PROGRAM} [a-z][^'\n]*)'", source)


def find_command(words: list[str]) -> tuple[Any, list[str]]:
    """The command that the first words name, and the words after them."""
    command = ROOT
    while words and words[0] in getattr(command, "commands", {}):
        command, words = command.commands[words[0]], words[1:]
    return command, words


def own_options(command: Any) -> set[str]:
    return {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}


def assert_mentioned_rightly(text: str) -> None:
    """The command exists, and so does each option; arguments may be left out."""
    command, rest = find_command(text.split()[1:])
    assert command is not ROOT, f"no such command: {text}"
    if hasattr(command, "commands"):
        assert not rest or rest[0].startswith("-"), f"no such command: {text}"
    known = own_options(command) | (
        {"--lamp", "--spectrum", "--dim", "--lumens"} if command.name == "relight" else set()
    )
    for option in re.findall(r"(?<![\w-])--[a-z][\w-]*", " ".join(rest)):
        assert option in known, f"{option} in: {text}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_example_on_a_page_is_understood(page: Path) -> None:
    for text in examples(page.read_text(encoding="utf-8")):
        command, rest = find_command(shlex.split(text, comments=True)[1:])
        assert not hasattr(command, "commands"), f"no such command: {text}"
        try:
            context = command.make_context(command.name, rest)  # reads the words, and runs nothing
        except Exception as fault:  # noqa: BLE001 - of any kind, told with the page's line
            pytest.fail(f"{text}: {fault!r}")
        if command.name == "relight":
            assert parse_orders(context.args)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_in_a_page_s_text_exists(page: Path) -> None:
    for text in mentions(page.read_text(encoding="utf-8")):
        assert_mentioned_rightly(text)


def test_every_command_that_the_program_advises_exists() -> None:
    sources = [path.read_text(encoding="utf-8") for path in sorted((PROJECT / PROGRAM).rglob("*.py"))]
    found = [text for source in sources for text in advice(source)]
    assert len(found) > 10  # the pattern still finds them
    for text in found:
        assert_mentioned_rightly(re.sub(r"\{.*", "", text))


def test_the_pages_do_show_commands() -> None:
    assert sum(len(list(examples(page.read_text(encoding="utf-8")))) for page in PAGES) >= 10
    assert sum(len(mentions(page.read_text(encoding="utf-8"))) for page in PAGES) >= 10


@pytest.mark.parametrize("text", ["lidarspectra relihgt room.run", "lidarspectra run room.toml --form trace"])
def test_a_wrong_command_would_be_seen(text: str) -> None:
    with pytest.raises(AssertionError):
        assert_mentioned_rightly(text)


def every_command(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    yield path
    for name, inner in getattr(command, "commands", {}).items():
        yield from every_command(inner, (*path, name))


def test_every_command_explains_itself_in_80_columns() -> None:
    for path in every_command(ROOT):
        answer = CliRunner(env={"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}).invoke(app, [*path, "--help"])
        assert answer.exit_code == 0, path
        lines = answer.output.splitlines()
        assert max(map(len, lines)) <= 80, path
        assert lines[3].strip() not in ("", "Options"), path  # it says what it does


def test_no_help_loses_a_unit_to_the_terminal_s_markup() -> None:
    for path in every_command(ROOT):
        command, _ = find_command(list(path))
        texts = [command.help or "", *(getattr(parameter, "help", None) or "" for parameter in command.params)]
        for text in texts:
            assert not re.search(r"(?<!\\)\[[a-z]", text.replace("[--", "")), (path, text)  # taken for a style
