"""Lamps reflected in panes of glass and in mirrors, and seen through glass, against closed forms.

A sensor gets from a flat mirror what a lamp of its reflectance would send from behind it; from a pane of glass the
share that Fresnel's equations give for the angle, of both surfaces together.
"""

import numpy as np
import pytest
import trimesh

from lidarspectra.radiance.sampling.trace import trace

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

INDEX = 1.52
CLEAR = 0.9179  # [1] transmittance at normal incidence of glass that absorbs nothing
LAMP_M = 0.02  # [m] side: its middle stands for it within 1e-4
LAMP = np.array([0.8, 0.0, 1.2])
PLACES = np.array([[0.8, 0.3, 0.0], [0.2, 0.0, 0.0], [1.5, 0.5, 0.3], [0.5, 0.0, 0.0], [0.7, -0.6, 0.2]])
NORMALS = np.array([[0, 0, 1], [0, 0, 1], [-0.8, 0, 0.6], [-1, 0, 0], [-0.6, 0, 0.8]])


def pane(x: float = 0.0, half: float = 3.0) -> trimesh.Trimesh:
    """A square across the x axis, of eight triangles."""
    mesh = trimesh.Trimesh(
        vertices=[[x, y, z] for y in (-half, 0, half) for z in (-half, 0, half)],
        faces=[[3 * i + j, 3 * i + j + 4, 3 * i + j + 3] for i in (0, 1) for j in (0, 1)]
        + [[3 * i + j, 3 * i + j + 1, 3 * i + j + 4] for i in (0, 1) for j in (0, 1)],
    )
    return mesh


def fresnel(cosine, inner: float = 1.0):
    """Reflected and transmitted share of a pane, by summing what goes to and fro in it; `inner` of each passage."""
    sine = np.sqrt(1.0 - cosine**2) / INDEX
    within = np.sqrt(1.0 - sine**2)
    absorbed = inner ** (1.0 / within)
    back, through = np.zeros_like(cosine), np.zeros_like(cosine)
    for one in (
        ((cosine - INDEX * within) / (cosine + INDEX * within)) ** 2,
        ((INDEX * cosine - within) / (INDEX * cosine + within)) ** 2,
    ):
        back = back + 0.5 * one
        light = (1.0 - one) * absorbed
        for turn in range(40):
            if turn % 2 == 0:
                through = through + 0.5 * light * (1.0 - one)
            else:
                back = back + 0.5 * light * (1.0 - one)
            light = light * one * absorbed
    return back, through


def from_lamp(lamp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficient [m⁻²] of a small level panel at `lamp` at the places, and cosine of the way to the x axis."""
    away = lamp - PLACES
    distance = np.linalg.norm(away, axis=1)
    unit = away / distance[:, None]
    sensor = np.maximum(np.einsum("ij,ij->i", unit, NORMALS), 0.0)
    return sensor * np.maximum(unit[:, 2], 0.0) / (np.pi * distance**2), np.abs(unit[:, 0])


@BY_ITS_ERROR
@pytest.mark.parametrize("transmittance", [CLEAR, 0.5])
def test_a_lamp_is_seen_reflected_in_a_pane_of_glass(rooms, sensors, section, check, transmittance: float) -> None:
    glass = rooms.wall(0.08, kind="glass", transmittance=transmittance)
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), glass)])
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    inner = {CLEAR: 1.0, 0.5: 0.5463}[transmittance]  # with both surfaces' reflections it lets .5 through
    direct, _ = from_lamp(LAMP)
    image, cosine = from_lamp(LAMP * [-1, 1, 1])
    expected = direct + image * fresnel(cosine, inner)[0]
    assert np.max(expected / np.maximum(direct, 1e-30)) > 1.5  # there is something to see
    check(transport, expected[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_a_lamp_is_seen_through_a_pane_of_glass(rooms, sensors, section, check) -> None:
    glass = rooms.wall(0.08, kind="glass", transmittance=CLEAR)
    behind = LAMP * [-1, 1, 1]
    scene = rooms.scene([rooms.lamp("panel", behind, (LAMP_M, LAMP_M))], [(pane(), glass)])
    image, cosine = from_lamp(behind)
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    check(transport, (image * fresnel(cosine)[1])[:, None], shape=2e-3)


@BY_ITS_ERROR
def test_a_lamp_is_seen_in_a_mirror(rooms, sensors, section, check) -> None:
    mirror = rooms.wall(0.9, kind="mirror")
    scene = rooms.scene([rooms.lamp("panel", LAMP, (LAMP_M, LAMP_M))], [(pane(), mirror)])
    transport = trace(scene, sensors(PLACES, NORMALS), **section(), seed=1)
    check(transport, (from_lamp(LAMP)[0] + 0.9 * from_lamp(LAMP * [-1, 1, 1])[0])[:, None], shape=2e-3)
