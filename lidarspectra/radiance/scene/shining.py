"""Surfaces that lamps shine from, as far as their radiance has a formula or a table: what ray casting needs of them.

Their light straight to a sensor, and reflected once, is integrated by `sampling.cast_light`. Windows with a sky behind
them and the sun are none of these: what they send is known to the engine alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.ies import CandelaTable
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import CandelaPattern, CosinePower, Lambertian
from lidarspectra.lamps.surfaces import Circle, Place, Rectangle, Sphere

DARK_COSINE = 1e-12  # [1] of the angle to a surface's normal, below which it sends nothing
_PLACE_ARRAYS = ("center", "length", "width", "normal")


@dataclass(frozen=True, kw_only=True, eq=False)
class ShiningSurface:
    """A surface of a lamp, of radiance L(θ)/Φ = (n + 1)/(2πA) cosⁿ⁻¹θ or (I(θ, φ)/Φ_v)/(A cosθ).

    Parameters
    ----------
    lamp : int
        Index of the scene's lamp.
    surface : Rectangle, Circle or Sphere
    area : float
        A: what the lamp's flux is spread over by its pattern. [m²]
    exponent : float
        n; 1 is Lambertian. [1]
    table : CandelaTable, optional
        I/Φ_v; θ from `axis`, φ from the length. [1/sr]
    axis : Place, optional
        Of the lamp, that the table's angles count from.
    """

    lamp: int
    surface: Rectangle | Circle | Sphere
    area: float
    exponent: float = 1.0
    table: CandelaTable | None = None
    axis: Place | None = None

    def radiance(self, leaving: FloatArray, cosine: FloatArray) -> FloatArray:
        """L/Φ towards some directions.

        Parameters
        ----------
        leaving : (..., 3) float
            Unit vectors away from the surface.
        cosine : (...) float
            Of their angle to its normal. [1]

        Returns
        -------
        radiance : (...) float
            0 behind it. [1/(m² sr)]
        """
        shines = cosine > DARK_COSINE
        slant = np.where(shines, cosine, 1.0)
        if self.table is None or self.axis is None:
            value = (self.exponent + 1.0) / (2.0 * np.pi * self.area) * slant ** (self.exponent - 1.0)
            return np.where(shines, value, 0.0)
        theta = np.degrees(np.arccos(np.clip(leaving @ self.axis.normal, -1.0, 1.0)))
        phi = np.degrees(np.arctan2(-(leaving @ self.axis.width), leaving @ self.axis.length))
        intensity = self.table.at(theta.ravel(), phi.ravel()).reshape(theta.shape)
        return np.where(shines, intensity / (self.area * slant), 0.0)


def find_shining(lamps: Sequence[Lamp]) -> tuple[ShiningSurface, ...]:
    """The surfaces of those lamps whose radiance has a formula or a table."""
    found = []
    for number, lamp in enumerate(lamps):
        pattern = lamp.shape.pattern
        if not isinstance(pattern, Lambertian | CosinePower | CandelaPattern):
            continue
        exponent = pattern.exponent if isinstance(pattern, CosinePower) else 1.0
        table = _per_lumen(pattern.table) if isinstance(pattern, CandelaPattern) else None
        for surface in lamp.surfaces:
            assert isinstance(surface, Rectangle | Circle | Sphere)  # there are no others
            found.append(
                ShiningSurface(
                    lamp=number,
                    surface=surface,
                    area=lamp.shape.area,
                    exponent=exponent,
                    table=table,
                    axis=None if table is None else lamp.place,
                )
            )
    return tuple(found)


def _per_lumen(table: CandelaTable) -> CandelaTable:
    return CandelaTable(
        vertical_deg=table.vertical_deg,
        horizontal_deg=table.horizontal_deg,
        candela=table.candela / table.luminous_flux_lm(),
        opening_m=table.opening_m,
    )


def record_of_shining(shining: Sequence[ShiningSurface]) -> dict[str, Any]:
    """For the scene's record; `shining_of_record` reads it. Equal tables are written once."""
    tables: list[dict[str, Any]] = []
    surfaces = []
    for each in shining:
        surface = each.surface
        entry: dict[str, Any] = {"lamp": each.lamp, "area": each.area, "exponent": each.exponent}
        if isinstance(surface, Sphere):
            entry |= {"center": surface.center.tolist(), "size": [surface.diameter]}
        else:
            size = [surface.diameter] if isinstance(surface, Circle) else [surface.length, surface.width]
            entry |= {**_place_record(surface.place), "size": size}
        if each.table is not None and each.axis is not None:
            table = _table_record(each.table)
            if table not in tables:
                tables.append(table)
            entry |= {"table": tables.index(table), "axis": _place_record(each.axis)}
        surfaces.append(entry)
    return {"surfaces": surfaces, "tables": tables}


def shining_of_record(record: dict[str, Any]) -> tuple[ShiningSurface, ...]:
    """See `record_of_shining`."""
    tables = [
        CandelaTable(**{**table, **{name: np.array(table[name]) for name in _TABLE_ARRAYS}, "opening_m": (1.0, 1.0)})
        for table in record.get("tables", ())
    ]
    found = []
    for entry in record.get("surfaces", ()):
        size = [float(each) for each in entry["size"]]
        surface: Rectangle | Circle | Sphere
        if "normal" not in entry:
            surface = Sphere(np.array(entry["center"]), size[0])
        elif len(size) == 1:
            surface = Circle(_place_of_record(entry), size[0])
        else:
            surface = Rectangle(_place_of_record(entry), size[0], size[1])
        found.append(
            ShiningSurface(
                lamp=entry["lamp"],
                surface=surface,
                area=entry["area"],
                exponent=entry["exponent"],
                table=tables[entry["table"]] if "table" in entry else None,
                axis=_place_of_record(entry["axis"]) if "axis" in entry else None,
            )
        )
    return tuple(found)


_TABLE_ARRAYS = ("vertical_deg", "horizontal_deg", "candela")


def _table_record(table: CandelaTable) -> dict[str, Any]:
    return {name: np.asarray(getattr(table, name)).tolist() for name in _TABLE_ARRAYS}


def _place_record(place: Place) -> dict[str, Any]:
    return {name: getattr(place, name).tolist() for name in _PLACE_ARRAYS}


def _place_of_record(record: dict[str, Any]) -> Place:
    return Place(**{name: np.array(record[name]) for name in _PLACE_ARRAYS})
