"""The report's HTML: one self-contained page, in which no text from a user's file can act as HTML or script.

All text is escaped by `words`; scripts other than our own are refused by the page's content security policy.
"""

import base64
import hashlib
import html
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from itertools import count

from PIL import Image

from lidarspectra.arrays import ByteArray
from lidarspectra.mapping.figures.figure_style import data_uri
from lidarspectra.mapping.figures.printable import printable

VIEW_WIDTH_PX = 640  # [px] pictures in the page; the full ones lie in the run's folder
ROOM_SCRIPTS = ("three.js", "room-picture.js", "room-light.js", "room-chart.js", "room-lamps.js", "room-view.js")
FIGURE_NUMBER = "<!-- figure -->"  # stands for it until the figure's place in the document is known
JPEG_QUALITY = 85  # Pillow's scale; no visible loss at this size


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the page.

    Parameters
    ----------
    anchor : str
        Its id, ours to choose.
    title : str
        Heading, also in the table of contents.
    content : str
        HTML.
    """

    anchor: str
    title: str
    content: str


def words(text: object) -> str:
    """Any text, escaped for HTML."""
    return html.escape(printable(str(text)), quote=True)


def paragraph(text: str, *, css_class: str = "") -> str:
    """A paragraph of plain text."""
    kind = f' class="{words(css_class)}"' if css_class else ""
    return f"<p{kind}>{words(text)}</p>"


def cards(entries: Sequence[tuple[str, str, str]]) -> str:
    """Key figures: (name, value, remark) each."""
    inner = "".join(
        f"<div><dt>{words(what)}</dt><dd>{words(value)}{f'<small>{words(remark)}</small>' if remark else ''}</dd></div>"
        for what, value, remark in entries
    )
    return f'<dl class="cards">{inner}</dl>'


@dataclass(frozen=True, kw_only=True)
class Fact:
    """A key figure above the room.

    Parameters
    ----------
    name, value, remark : str
        What it is, its value with the unit, and a few words on it.
    fact : str
        'mean' or 'uniformity' of `key` over the points, for the page to tell it anew under other lamps; or ''.
    key : str
        Of the quantity in the page's data.
    number : float
        The value without rounding.
    unit : str
        Of the value.
    link : str
        Anchor of what is behind it.
    """

    name: str
    value: str
    remark: str
    fact: str = ""
    key: str = ""
    number: float = 0.0
    unit: str = ""
    link: str = ""


def facts(entries: Sequence[Fact]) -> str:
    """The key figures above the room."""
    return f'<dl class="facts">{"".join(map(_fact, entries))}</dl>'


def _fact(entry: Fact) -> str:
    fields = {"fact": entry.fact, "key": entry.key, "number": f"{entry.number:.9g}", "unit": entry.unit}
    data = "".join(f' data-{name}="{words(value)}"' for name, value in fields.items()) if entry.fact else ""
    name = f'<a href="#{words(entry.link)}">{words(entry.name)}</a>' if entry.link else words(entry.name)
    value, remark = f'<span class="value">{words(entry.value)}</span>', f"<small>{words(entry.remark)}</small>"
    return f"<div{data}><dt>{name}</dt><dd>{value}{remark}</dd></div>"


def figure(svg: str, *, caption: str, name: str, kinds: Sequence[str]) -> str:
    """A figure that `page_svg` made, with its caption and links to its files; the document gives it its number."""
    text = f"<b>Figure {FIGURE_NUMBER}.</b> {words(caption)} {files(f'figures/{name}', kinds)}"
    plate = f'<div class="plate">{svg}</div>'
    return f'<figure id="figure-{words(name)}">{plate}<figcaption>{text}</figcaption></figure>'


def pictures(views: Sequence[tuple[str, ByteArray]]) -> str:
    """Pictures side by side, each under its name."""
    inner = "".join(
        f'<figure><img src="{_jpeg(image)}" alt="View: {words(name)}"><figcaption>{words(name)}</figcaption></figure>'
        for name, image in views
    )
    return f'<div class="views">{inner}</div>'


def files(stem: str, kinds: Sequence[str]) -> str:
    """Links to files beside the page; `stem` is ours to choose."""
    if not kinds:
        return ""
    links = ", ".join(f'<a href="{words(stem)}.{kind}">{kind.upper()}</a>' for kind in kinds)
    return f'<span class="files">[{links}]</span>'


def warning_box(warnings: Sequence[str]) -> str:
    """Notes that the reader must know before using the numbers."""
    if not warnings:
        return ""
    inner = "".join(f"<li>{words(warning)}</li>" for warning in warnings)
    return f'<aside class="warnings" aria-label="Warnings"><p>Please note</p><ul>{inner}</ul></aside>'


def details(summary: str, content: str) -> str:
    """Content that is folded until it is clicked."""
    return f"<details><summary>{words(summary)}</summary>{content}</details>"


def code(text: str) -> str:
    """Text as it stands in a file."""
    return f"<pre><code>{words(text)}</code></pre>"


def pairs(entries: Mapping[str, str]) -> str:
    """A table of two columns, name and value."""
    rows = "".join(
        f'<tr><th scope="row">{words(name)}</th><td>{words(value)}</td></tr>' for name, value in entries.items()
    )
    return f'<div class="scroll" tabindex="0"><table><tbody>{rows}</tbody></table></div>'


def room_view() -> str:
    """The 3D view's controls and its empty picture, which the page's scripts fill."""
    return resource("room-view.html")


def page(
    *, title: str, lead: str, sections: Sequence[Section], footer: str, room_data: str = "", key_figures: str = ""
) -> str:
    """The whole page.

    Parameters
    ----------
    title, lead, footer : str
        Plain text.
    key_figures : str
        HTML between the title and the first section.
    sections : sequence of Section
        In order.
    room_data : str
        JSON of `room_view_data`, for a page that has a `room_view`.

    Returns
    -------
    page : str
        HTML 5 without any address to load from.
    """
    scripts = [resource(name) for name in (*(ROOM_SCRIPTS if room_data else ()), "script.js")]
    contents = "".join(f'<li><a href="#{words(part.anchor)}">{words(part.title)}</a></li>' for part in sections)
    parts = "".join(
        f'<section id="{words(part.anchor)}" aria-labelledby="{words(part.anchor)}-title">'
        f'<h2 id="{words(part.anchor)}-title">{words(part.title)}</h2>{part.content}</section>\n'
        for part in sections
    )
    body = (
        '<a class="skip" href="#content">Skip to the content</a>\n<div class="layout">\n'
        f'<nav aria-label="Contents"><p>LiDARSpectra</p><ol>{contents}</ol></nav>\n'
        f'<main id="content"><header><h1>{words(title)}</h1>{paragraph(lead)}</header>\n{key_figures}{parts}'
        f"<footer>{paragraph(footer)}</footer></main>\n</div>"
    )
    data = {"room-data": room_data} if room_data else {}
    return document(title=title, style=resource("style.css"), body=body, scripts=scripts, data=data)


def document(
    *,
    title: str,
    style: str,
    body: str,
    scripts: Sequence[str],
    data: Mapping[str, str] | None = None,
    connect: bool = False,
) -> str:
    """A page of our own parts, which runs no other script than those given.

    Parameters
    ----------
    title : str
        Plain text.
    style, body : str
        CSS and HTML; its figures are numbered here.
    scripts : sequence of str
        JavaScript, in order, after the body.
    data : mapping of str to str
        JSON without a '<', by the id of its element.
    connect : bool
        Let the scripts speak with the server that the page is from.

    Returns
    -------
    page : str
        HTML 5.
    """
    allowed = " ".join(f"'sha256-{_digest(script)}'" for script in scripts)
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src {allowed}"
    policy += "; connect-src 'self'" if connect else ""
    held = "".join(
        f'<script type="application/json" id="{words(name)}">{content}</script>\n'
        for name, content in (data or {}).items()
    )
    running = "\n".join(f"<script>{script}</script>" for script in scripts)
    number = count(1)
    body = re.sub(FIGURE_NUMBER, lambda _: str(next(number)), body)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{words(policy)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{words(title)} – LiDARSpectra</title>\n<style>\n{style}</style>\n</head>\n<body>\n"
        f"{body}\n{held}{running}\n</body>\n</html>\n"
    )


def _digest(script: str) -> str:
    """SHA-256 of a script, by which the content security policy allows it."""
    return base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")


@cache
def resource(name: str) -> str:
    """A file of the folder `page`."""
    return (
        (resources.files("lidarspectra.mapping.report") / "page" / name)
        .read_text(encoding="utf-8")
        .replace("\r\n", "\n")
    )


def _jpeg(image: ByteArray) -> str:
    picture = Image.fromarray(image)
    picture.thumbnail((VIEW_WIDTH_PX, VIEW_WIDTH_PX))
    stream = io.BytesIO()
    picture.save(stream, format="JPEG", quality=JPEG_QUALITY)
    return data_uri(stream.getvalue(), "image/jpeg")
