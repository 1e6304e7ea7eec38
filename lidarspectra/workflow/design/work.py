"""What a design rests on: the room, the lamps, their light, and the conditions on it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import RunFileError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.design.conditions import Condition, Kind
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import BandSet, Spectrum
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.lamps import DesignedLamp, DesignLamps
from lidarspectra.workflow.design.light import DesignLight, TracedLamps
from lidarspectra.workflow.design.points import TargetPoints
from lidarspectra.workflow.design.target import Target, TargetSection

Values = list[tuple[float, float]]


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignWork:
    """What a design rests on, for its files and its check.

    Parameters
    ----------
    room : RunRoom
    target : Target
    lamps : DesignLamps
    light : DesignLight
    conditions : tuple of (Condition, TargetPoints)
    designed : tuple of DesignedLamp
    """

    room: RunRoom
    target: Target
    lamps: DesignLamps
    light: DesignLight
    conditions: tuple[tuple[Condition, TargetPoints], ...]
    designed: tuple[DesignedLamp, ...]

    @property
    def fluxes(self) -> dict[str, Spectrum]:
        """What every lit lamp sends, by name [W/nm]."""
        fixed = {lamp.name: lamp.flux for lamp in self.lamps.fixed}
        return fixed | {each.of.lamp.name: each.flux for each in self.designed if each.shares}

    @property
    def lit_lamps(self) -> tuple[Lamp, ...]:
        """The lamps of the design that are lit, as they then are."""
        lit = [replace(each.of.lamp, flux=each.flux) for each in self.designed if each.shares]
        return (*self.lamps.fixed, *lit)

    def values(self, run: TracedLamps, own: TracedLamps | None, fluxes: Mapping[str, Spectrum]) -> Values:
        """Value and standard error of every condition.

        Parameters
        ----------
        run, own : TracedLamps
            Lamps at the run's points, and at places that the targets name.
        fluxes : mapping of str to Spectrum
            Of the lamps that are lit. [W/nm]
        """
        light: dict[bool, PointLight] = {False: run.lit(fluxes)}
        if own is not None:
            light[True] = own.lit(fluxes)
        return [condition.value(light[points.own].at(points.index)) for condition, points in self.conditions]

    @property
    def predicted(self) -> Values:
        """Under the lamps as designed."""
        return self.values(self.light.run, self.light.own, self.fluxes)

    @property
    def before(self) -> Values:
        """Under the lamps of the run as they are."""
        return self.values(self.light.run_before, self.light.own_before, self.light.run_before.fluxes)


def conditions_of(section: TargetSection, bands: BandSet, *, where: str, base: Path) -> tuple[Condition, ...]:
    """Every condition of a target.

    Raises
    ------
    RunFileError
        If it gives another number of channels than the run has.
    DatabaseError
        If there is no such spectrum.
    """
    quantity, of_mean = light_quantity(section.quantity), section.of == "mean"
    found = []
    levels: dict[Kind, float | None] = {
        "at least": section.at_least, "at most": section.at_most, "about": section.about,
    }  # fmt: skip
    for kind, level in levels.items():
        if level is not None:
            found.append(Condition(target=section.name, kind=kind, quantity=quantity, wanted=level, of_mean=of_mean))
    if section.uniformity is not None:
        found.append(Condition(target=section.name, kind="uniformity", quantity=quantity, wanted=section.uniformity))
    shape = _shape(section, bands, where=where, base=base)
    if shape is not None:
        height = float(section.at_least or section.about or 0.0)  # one of them is given with a form
        found.append(Condition(target=section.name, kind="spectrum", quantity=quantity, wanted=height, shape=shape))
    return tuple(found)


def _shape(section: TargetSection, bands: BandSet, *, where: str, base: Path) -> FloatArray | None:
    if section.channels is not None:
        if len(section.channels) != len(bands):
            raise RunFileError(
                expected=f"{len(bands)} channels, those of the run ({', '.join(bands.labels)} nm)",
                found=f"{len(section.channels)}",
                where=f"{where}, target '{section.name}'",
            )
        return np.array(section.channels)
    if section.spectrum is None:
        return None
    return bands.band_values(lamp_spectrum(section.spectrum, base).spectrum, outside="zero")
