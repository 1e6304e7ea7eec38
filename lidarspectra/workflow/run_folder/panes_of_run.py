"""Glass, mirrors and screens of a run: those that the run file has, and what the user is asked of those it lacks."""

from collections.abc import Iterator, Sequence

import numpy as np

from lidarspectra.config import PaneSection
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.toml_text import toml_value, toml_vector
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.pane_materials import pane_material, with_pane_materials
from lidarspectra.room.panes.pane import Pane

WHAT_TO_DO = {
    "glass": 'write it under [[panes]] with kind = "glass" if it is: light goes through it, where paint returns it',
    "mirror": 'write it under [[panes]] with kind = "mirror", or "glass" if it is a window by night: until then the '
    "image behind it counts as a part of the room",
    "screen": 'write it under [[panes]] with kind = "screen" if it is one: what it shows in the picture is no paint',
}


def panes_of_run(sections: Sequence[PaneSection]) -> tuple[Pane, ...]:
    """The panes of `[[panes]]`."""
    return tuple(
        Pane(kind=each.kind, center=np.array(each.center), size_m=each.size, normal=np.array(each.normal))
        for each in sections
    )


def with_panes_of_run(materials: MaterialMap, scan: Scan, sections: Sequence[PaneSection]) -> MaterialMap:
    """Materials with those of the run file's panes, on a scan with the panes in place."""
    if not sections:
        return materials
    made = [
        pane_material(each.kind, name=each.name, transmittance=each.transmittance, reflectance=each.reflectance)
        for each in sections
    ]
    return with_pane_materials(materials, scan, list(zip(panes_of_run(sections), made, strict=True)))


def found_notes(found: Sequence[Pane], given: Sequence[Pane]) -> Iterator[str]:
    """A note for each pane that was found in a scan and that the run file does not have."""
    for pane in found:
        if not any(pane.overlaps(other) for other in given):
            yield f"There is probably {pane.in_words()}, since {pane.why}: {WHAT_TO_DO[pane.kind]}."


def assumed_notes(sections: Sequence[PaneSection]) -> tuple[str, ...]:
    """A note where panes of the run file are guesses."""
    guesses = [f"'{each.name}' ({each.kind})" for each in sections if each.assumed]
    if not guesses:
        return ()
    return (
        f"{', '.join(guesses)} under [[panes]] {'are guesses' if len(guesses) > 1 else 'is a guess'}: look whether "
        "that is there, correct its place and size, or remove it; then delete 'assumed' there.",
    )


def pane_lines(panes: Sequence[Pane]) -> Iterator[str]:
    """Lines of a run file that propose panes."""
    if not panes:
        return
    yield ""
    yield "# Glass, mirrors and screens, by signs of them in the scan: ASSUMED. Correct places, sizes and kinds, and"
    yield "# remove what is none of them. Glass lets light through, and what a mirror shows is cut off."
    numbers: dict[str, int] = {}
    for pane in panes:
        numbers[pane.kind] = numbers.get(pane.kind, 0) + 1
        yield ""
        yield "[[panes]]"
        yield f"name = {toml_value(f'{pane.kind} {numbers[pane.kind]}')}  # {pane.why}"
        yield f"kind = {toml_value(pane.kind)}"
        yield f"center = {toml_vector(pane.center.tolist())}  # [m]"
        yield f"size = {toml_vector(list(pane.size_m))}  # width, height [m]"
        yield f"normal = {toml_vector(pane.normal.tolist())}  # into the room"
        for key, share in (("transmittance", pane.transmittance), ("reflectance", pane.reflectance)):
            if share is not None:
                yield f"{key} = {toml_value(share)}  # as the frames tell"
        yield "assumed = true  # a guess; delete this line once you have looked"


def panes_in_words(panes: Sequence[Pane]) -> str:
    """Panes for a summary: what and where, one after the other."""
    return "; ".join(pane.in_words() for pane in panes)
