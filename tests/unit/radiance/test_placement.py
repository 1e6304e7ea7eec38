"""Lamps in walls, above ceilings or behind the mesh draw a note, others none; lamps with the same fault share one."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, shape_of
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.spectra.spectrum import Spectrum


@pytest.fixture(scope="module")
def room() -> Scan:
    """3 m x 3 m x 2.7 m, seen from inside."""
    box = trimesh.creation.box(extents=(3.0, 3.0, 2.7))
    box.invert()
    count = len(box.faces)
    return Scan(
        vertices=box.vertices + [1.5, 1.5, 1.35],
        faces=box.faces,
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(
            file="room", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=12, faces_kept=12
        ),
    )


def notes(room: Scan, shape: str, center: tuple[float, ...], size: tuple[float, ...], normal=(0, 0, -1)) -> str:
    lamp = Lamp(
        name="Lampe é",
        shape=shape_of(shape, size),
        center=np.array(center),
        normal=np.array(normal),
        flux=Spectrum(wavelengths_nm=[400, 700], values=[1, 1]),
    )
    return " ".join(placement_notes([lamp], room))


def test_lamps_in_the_air_draw_no_note(room: Scan) -> None:
    assert notes(room, "panel", (1.5, 1.5, 2.69), (0.6, 0.6)) == ""  # 1 cm below the ceiling
    assert notes(room, "bulb", (1.5, 1.5, 1.0), (0.06,)) == ""
    assert notes(room, "window", (0.06, 1.5, 1.5), (1.0, 1.0), (1, 0, 0)) == ""


@pytest.mark.parametrize(
    ("shape", "center", "size", "words"),
    [
        ("bulb", (0.02, 1.5, 1.0), (0.06,), "partly behind"),
        ("panel", (1.5, 1.5, 2.75), (0.6, 0.6), "outside the scan"),
        ("disc", (9.0, 1.5, 1.5), (0.2,), "outside the scan"),
        ("panel", (0.2, 1.5, 2.5), (0.6, 0.6), "partly behind"),
    ],
)
def test_misplaced_lamps_are_named_with_their_fault(
    room: Scan, shape: str, center: tuple[float, ...], size: tuple[float, ...], words: str
) -> None:
    note = notes(room, shape, center, size)
    assert words in note
    assert "Lampe é" in note


def test_lamps_with_the_same_fault_share_one_note(room: Scan) -> None:
    lamps = [
        Lamp(
            name=f"lamp {number}",
            shape=Bulb(),
            center=np.array((0.02, 1.5, 1.0)),
            flux=Spectrum(wavelengths_nm=[400, 700], values=[1, 1]),
        )
        for number in range(16)
    ]
    lamps.append(replace(lamps[0], name="far", center=np.array((9.0, 1.5, 1.5))))
    outside, hidden = placement_notes(lamps, room)
    assert outside.startswith("Lamp 'far' (at 9.00, 1.50, 1.50 m) is outside the scan")
    assert hidden.startswith("Lamps 'lamp 0' (")
    assert "% of its light) and 10 more are partly behind" in hidden


def test_a_lamp_that_shines_into_a_wall_is_behind_it(room: Scan) -> None:
    turned = Scan(vertices=room.vertices, faces=room.faces[:, ::-1], appearance=room.appearance, record=room.record)
    assert "behind" in notes(turned, "panel", (1.5, 1.5, 1.5), (0.6, 0.6))
