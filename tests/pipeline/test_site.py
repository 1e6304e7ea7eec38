"""The site is built without a warning, its gallery runs, and what it and the sources say of each other is true."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import lidarspectra


@pytest.mark.slow
@pytest.mark.longest
def test_the_site_is_built_without_a_warning_and_its_gallery_has_pictures(project: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", tmp_path / "trees", project / "docs", site],
        capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    examples = sorted((project / "docs" / "gallery").glob("*.py"))
    assert len(examples) >= 4
    page = (site / "gallery" / "index.html").read_text(encoding="utf-8")
    for example in examples:
        assert (site / "_images" / f"{example.stem}.png").stat().st_size > 5000
        assert f"{example.stem}.png" in page
    for html in site.rglob("*.html"):  # it can be read without a network
        assert not re.findall(
            r'<(?:script|link|img)[^>]+(?:src|href)="(?:https?:)?//', html.read_text(encoding="utf-8")
        ), html


def concept_equations(project: Path) -> list[int]:
    return [
        int(number)
        for number in re.findall(r"\$\$ \(eq-(\d+)\)", (project / "docs" / "concepts.md").read_text("utf-8"))
    ]


def test_the_equations_of_the_concepts_are_numbered_as_they_stand(project: Path) -> None:
    numbers = concept_equations(project)
    assert numbers == list(range(1, len(numbers) + 1))
    assert len(numbers) >= 13


def test_every_equation_that_a_source_or_page_cites_is_there(project: Path) -> None:
    texts = [*(project / "lidarspectra").rglob("*.py"), *(project / "docs").rglob("*.md")]
    cited = [
        int(number)
        for path in texts
        for words in re.findall(
            r"(?:docs/concepts\.md|\[concepts), Eq\. ([\d, to and]+)", path.read_text(encoding="utf-8")
        )
        for number in re.findall(r"\d+", words)
    ]
    assert set(cited) <= set(concept_equations(project))
    sources = [
        path for path in texts if path.suffix == ".py" and "docs/concepts.md, Eq." in path.read_text(encoding="utf-8")
    ]
    assert len(sources) >= 8


def test_every_library_that_is_asked_for_has_its_licence_on_the_page(project: Path) -> None:
    table = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    asked = [*table["dependencies"], *(name for extra in table["optional-dependencies"].values() for name in extra)]
    page = (project / "docs" / "licences.md").read_text(encoding="utf-8").casefold()
    for requirement in asked:
        name = re.split(r"[<>=!~\[; ]", requirement)[0]
        if name != "lidarspectra":
            assert re.search(rf"(?<![\w-]){re.escape(name.casefold())}(?![\w-])", page), name


def test_the_version_is_the_same_everywhere(project: Path) -> None:
    citation = yaml.safe_load((project / "CITATION.cff").read_text(encoding="utf-8"))
    changes = (project / "CHANGELOG.md").read_text(encoding="utf-8")
    newest = re.search(r"^## \[(\d+\.\d+\.\d+)\]", changes, flags=re.MULTILINE)
    assert newest is not None
    assert citation["version"] == newest[1] == lidarspectra.__version__


def test_the_glossary_is_in_order_and_says_each_word_once(project: Path) -> None:
    page = (project / "docs" / "glossary.md").read_text(encoding="utf-8")
    words = re.findall(r"^([a-z][\w -]*)\n  \S", page, flags=re.MULTILINE)
    assert len(words) > 30
    assert words == sorted(set(words))
