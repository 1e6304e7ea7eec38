"""How the site is made: `make docs`."""

import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from lidarspectra.garbage import collect_rarely

SINGLE_BACKTICKS = re.compile(r"(?<![`:])`([^`]+)`(?![`_])")

collect_rarely()  # Sphinx makes a million nodes of text, and drops few of them

project = "LiDARSpectra"
author = "The LiDARSpectra developers"
project_copyright = "2026, the LiDARSpectra developers"
version = release = installed_version("lidarspectra")

sys.path.insert(0, str(Path(__file__).parent))  # for site_directives
extensions = [
    "site_directives",
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx-mathjax-offline",  # formulas show without a network
    "matplotlib.sphinxext.plot_directive",  # runs the gallery
]
exclude_patterns = ["_build", "results", "results-localization"]  # results.md and its like hold what their parts say
suppress_warnings = ["myst.header"]  # a page may begin its sections where it likes

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
math_eqref_format = "Eq. {number}"

autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say type, shape and unit
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

plot_html_show_source_link = False
plot_html_show_formats = False
plot_formats = [("png", 110)]
plot_include_source = True

html_theme = "furo"
html_title = "LiDARSpectra"
html_show_sourcelink = False
html_copy_source = False
copybutton_prompt_text = "$ "


def plain_text_to_rst(app, what, name, obj, options, lines):
    """Docstrings are written to be read as they are: keep their bars, their code, and the lines of what they indent."""
    text = [f".. rubric:: {name}", ""] if what == "module" else []
    for line in lines:
        indented = what == "module" and line.startswith("    ")
        if indented and not text[-1]:
            before = next((each for each in reversed(text) if each), "")
            text += [] if before.startswith("    ") else ["::", ""]
        text.append(line if indented else SINGLE_BACKTICKS.sub(r"``\1``", line.replace("|", "\\|")))
    lines[:] = text


def setup(app):
    # Before napoleon, whose own priority is the default of 500.
    app.connect("autodoc-process-docstring", plain_text_to_rst, priority=400)
