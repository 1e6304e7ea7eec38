"""What the site takes from the program when it is built: every command's help, every shipped file's licence."""

import contextlib
import io
import os
import tomllib
from unittest.mock import patch

from docutils import nodes
from docutils.parsers.rst import Directive
from typer.main import get_command

from lidarspectra.cli.app import app
from lidarspectra.spectra.databases import data_folder

PLAIN = {"COLUMNS": "80", "NO_COLOR": "1", "TERM": "dumb"}


class Commands(Directive):
    """A section for each command, and for each command of a group."""

    def run(self):
        whole = get_command(app)
        return [section(whole, path) for path in every_command(whole, ())]


def every_command(command, path):
    """Words that name a command, depth first; groups are only walked through."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield path
        return
    for name in inner:
        yield from every_command(inner[name], (*path, name))


def section(command, path):
    """The name of a command within the whole one as a heading, its help below."""
    name = " ".join(path)
    told = io.StringIO()
    with patch.dict(os.environ, PLAIN), contextlib.redirect_stdout(told):
        command.main([*path, "--help"], prog_name="lidarspectra", standalone_mode=False)
    text = told.getvalue()
    whole = nodes.section(ids=[nodes.make_id(f"command {name}")])
    whole += nodes.title(name, name)
    block = nodes.literal_block(text, "\n".join(line.rstrip() for line in text.strip("\n").splitlines()))
    block["language"] = "text"
    whole += block
    return whole


class ShippedData(Directive):
    """A table of the databases' files: what each is, where it comes from, and its licence."""

    def run(self):
        manifest = tomllib.loads((data_folder() / "MANIFEST.toml").read_text(encoding="utf-8"))
        rows = [(each["title"], each["source"], each["licence"]) for each in manifest["file"]]
        group = nodes.tgroup(cols=3)
        group += [nodes.colspec(colwidth=width) for width in (35, 35, 30)]
        group += nodes.thead("", row(("what it is", "source", "licence")))
        group += nodes.tbody("", *map(row, rows))
        return [nodes.table("", group)]


def row(cells):
    """A row of plain text."""
    return nodes.row("", *(nodes.entry("", nodes.paragraph(text=cell)) for cell in cells))


def setup(app):
    app.add_directive("commands", Commands)
    app.add_directive("shipped-data", ShippedData)
    return {"parallel_read_safe": True}
