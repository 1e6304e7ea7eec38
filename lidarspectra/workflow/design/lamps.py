"""The lamps of a design: which may be changed, which spectra each may have, and what its light costs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lidarspectra.config import LampSection
from lidarspectra.errors import LampError, RunFileError
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.design.candidates import candidate_grid
from lidarspectra.mapping.design.problem import Sources
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.target import CandidatesSection, LibrarySection, Target

ASSUMED_EFFICACY_LM_W = 100.0  # [lm/W] of a common LED luminaire; said in a note wherever it is used
EDGE_NM = 1e-3  # [nm] within which a spectrum that ends above 0 falls to 0 in a mixture


@dataclass(frozen=True, kw_only=True, eq=False)
class SpectrumChoice:
    """A spectrum that a lamp may have.

    Parameters
    ----------
    name : str or None
        As the target file has it; None for the spectrum that the lamp has.
    flux : Spectrum
        Of the lamp with it, at full. [W/nm]
    watts : float
        Electrical power at full. [W]
    """

    name: str | None
    flux: Spectrum
    watts: float


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignLamp:
    """A lamp that may be changed.

    Parameters
    ----------
    lamp : Lamp
        At its full flux.
    section : LampSection or None
        Its table in the run file; None for a lamp that was found in the scan.
    present_dim : float
        Share of its flux in the run as it is; 0 for a candidate. [0-1]
    is_candidate : bool
    choices : tuple of SpectrumChoice
    """

    lamp: Lamp
    section: LampSection | None
    present_dim: float
    is_candidate: bool
    choices: tuple[SpectrumChoice, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignLamps:
    """All lamps of a design.

    Parameters
    ----------
    free : tuple of DesignLamp
        That may be changed, candidates last.
    fixed : tuple of Lamp
        That stay as they are.
    removed : tuple of str
        Lamps of the run in whose place the candidates are.
    assumed : tuple of str
        Lamps whose power was computed with the assumed efficacy.
    watts_before : float
        Power of the run's lamps that are not fixed, as they are. [W]
    """

    free: tuple[DesignLamp, ...]
    fixed: tuple[Lamp, ...]
    removed: tuple[str, ...]
    assumed: tuple[str, ...]
    watts_before: float

    @property
    def sources(self) -> Sources:
        """Each lamp with each of its spectra, lamp by lamp."""
        pairs = [(number, lamp, choice) for number, lamp in enumerate(self.free) for choice in lamp.choices]
        names = list(dict.fromkeys(choice.name for _, _, choice in pairs))
        return Sources(
            lamp=np.array([number for number, _, _ in pairs]),
            spectrum=np.array([names.index(choice.name) for _, _, choice in pairs]),
            watts=np.array([choice.watts for _, _, choice in pairs]),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignedLamp:
    """What a design makes of a lamp.

    Parameters
    ----------
    of : DesignLamp
    shares : tuple of (SpectrumChoice, float)
        Spectra that it is lit with, each with its share of the full flux; none where it is off. [0-1]
    """

    of: DesignLamp
    shares: tuple[tuple[SpectrumChoice, float], ...]

    @property
    def dim(self) -> float:
        """Share of its full flux; 0 where it is off [0-1]."""
        return sum(share for _, share in self.shares)

    @property
    def watts(self) -> float:
        """Its power [W]."""
        return sum(share * choice.watts for choice, share in self.shares)

    @property
    def flux(self) -> Spectrum:
        """What it sends; only where it is lit [W/nm]."""
        return mixture([(choice.flux, share) for choice, share in self.shares])


def design_lamps(target: Target, room: RunRoom, *, where: str, base: Path) -> DesignLamps:
    """Lamps that may be changed, and those that stay.

    Parameters
    ----------
    target : Target
    room : RunRoom
    where : str
        The target file, for errors.
    base : Path
        Where relative names of spectra in it start.

    Returns
    -------
    lamps : DesignLamps

    Raises
    ------
    RunFileError
        If a lamp is named that there is not, or none is left to be changed.
    LampError, DatabaseError
        If a spectrum is unknown or cannot be scaled.
    """
    daylight = room.run_file.daylight
    outside = set() if daylight is None else {"sun", *(window.name for window in daylight.windows)}
    _require_known((*target.lamps.fixed, *target.lamps.power_W), [lamp.name for lamp in room.lamps], where)
    sections = {section.name: section for section in room.run_file.lamps if section.dim > 0}
    inside = {lamp.name: lamp for lamp in room.lamps if lamp.name not in outside}
    fixed_names = outside | set(target.lamps.fixed)
    wanted = target.candidates
    library = _library(target, base)
    assumed: list[str] = []

    def free_lamp(lamp: Lamp, like: str, *, dim: float, is_candidate: bool) -> DesignLamp:
        choices = _choices(target, lamp, like, library, assumed)
        section = sections.get(like)
        return DesignLamp(lamp=lamp, section=section, present_dim=dim, is_candidate=is_candidate, choices=choices)

    full = {
        name: replace(lamp, flux=lamp.flux.scaled(1.0 / (sections[name].dim if name in sections else 1.0)))
        for name, lamp in inside.items()
    }
    kept = [name for name in inside if name not in fixed_names and (wanted is None or wanted.keep_lamps)]
    free = [
        free_lamp(full[name], name, dim=sections[name].dim if name in sections else 1.0, is_candidate=False)
        for name in kept
    ]
    if wanted is not None:
        like = _like(wanted, list(inside), where)
        free += [free_lamp(each, like, dim=0.0, is_candidate=True) for each in _candidates(wanted, full[like], room)]
        _require_unused([lamp.lamp.name for lamp in free if lamp.is_candidate], list(inside), where)
    if not free:
        raise RunFileError(
            expected="one or more lamps that may be changed",
            found="none: all are fixed" if room.lamps else "none",
            where=where,
            todo="Take a lamp out of 'fixed', or give [candidates].",
        )
    stays = fixed_names | set(kept)
    return DesignLamps(
        free=tuple(free),
        fixed=tuple(lamp for lamp in room.lamps if lamp.name in fixed_names),
        removed=tuple(name for name in inside if name not in stays),
        assumed=tuple(dict.fromkeys(assumed)),
        watts_before=sum(
            _present_watts(target, lamp, sections) for name, lamp in inside.items() if name not in fixed_names
        ),
    )


def mixture(parts: list[tuple[Spectrum, float]]) -> Spectrum:
    """Sum of spectra, each times its share [W/nm]."""
    used = [(spectrum, share) for spectrum, share in parts if share > 0]
    if len(used) == 1:
        return used[0][0].scaled(used[0][1])
    ends = [
        end + step for spectrum, _ in used for end, step in zip(spectrum.range_nm, (-EDGE_NM, EDGE_NM), strict=True)
    ]
    grid = np.unique(np.concatenate([*(spectrum.wavelengths_nm for spectrum, _ in used), ends]))
    values = sum(share * spectrum.at(grid, outside="zero") for spectrum, share in used)
    return Spectrum(wavelengths_nm=grid, values=np.asarray(values), name="mixture")


def _library(target: Target, base: Path) -> tuple[tuple[LibrarySection, Spectrum, bool], ...]:
    found = [(entry, lamp_spectrum(entry.spectrum, base)) for entry in target.spectra]
    return tuple((entry, each.spectrum, each.absolute) for entry, each in found)


def _choices(
    target: Target,
    lamp: Lamp,
    like: str,
    library: tuple[tuple[LibrarySection, Spectrum, bool], ...],
    assumed: list[str],
) -> tuple[SpectrumChoice, ...]:
    """Spectra of one lamp; the names of those whose power is assumed are added to `assumed`."""
    lumens = luminous_flux_lm(lamp.flux)
    watts = target.lamps.power_W.get(lamp.name, target.lamps.power_W.get(like))
    efficacy = lumens / watts if watts is not None else target.lamps.efficacy_lm_W
    choices = []
    if target.lamps.present_spectra:
        power = watts if watts is not None else _power(lumens, efficacy, lamp.name, assumed)
        choices.append(SpectrumChoice(name=None, flux=lamp.flux, watts=power))
    for entry, spectrum, is_absolute in library:
        own = luminous_flux_lm(spectrum)
        wanted = entry.luminous_flux_lm or (own if is_absolute else lumens)
        if own <= 0 or wanted <= 0:
            raise LampError(
                expected=f"a spectrum that can be scaled to {wanted:g} lm",
                found="one without visible light",
                where=f"[[spectra]] '{entry.spectrum}'",
                todo="Leave it out, or give luminous_flux_lm.",
            )
        power = _power(wanted, entry.efficacy_lm_W or efficacy, lamp.name, assumed)
        choices.append(SpectrumChoice(name=entry.spectrum, flux=spectrum.scaled(wanted / own), watts=power))
    return tuple(choices)


def _power(lumens: float, efficacy: float | None, name: str, assumed: list[str]) -> float:
    if efficacy is None:
        assumed.append(name)
        efficacy = ASSUMED_EFFICACY_LM_W
    if lumens <= 0:
        raise LampError(
            expected="the power of a lamp without visible light",
            found="none, and lumens a watt say nothing of it",
            where=f"lamp '{name}'",
            todo=f'Give it in the target file: [lamps.power_W] "{name}" = 40.',
        )
    return lumens / efficacy


def _present_watts(target: Target, lamp: Lamp, sections: Mapping[str, LampSection]) -> float:
    """Power of a lamp of the run as it is [W]."""
    if lamp.name in target.lamps.power_W:
        return target.lamps.power_W[lamp.name] * (sections[lamp.name].dim if lamp.name in sections else 1.0)
    return luminous_flux_lm(lamp.flux) / (target.lamps.efficacy_lm_W or ASSUMED_EFFICACY_LM_W)


def _require_known(names: tuple[str, ...], known: list[str], where: str) -> None:
    for name in names:
        if name not in known:
            raise RunFileError(
                expected=f"one of the run's lit lamps ({', '.join(known)})",
                found=f"'{name}'",
                where=f"{where}, [lamps]",
                todo="Name one of these; a lamp with dim = 0 in the run file was not traced.",
            )


def _require_unused(names: list[str], used: list[str], where: str) -> None:
    twice = sorted(set(names) & set(used))
    if twice:
        raise RunFileError(
            expected="a run without lamps of the candidates' names",
            found=f"'{twice[0]}'",
            where=f"{where}, [candidates]",
            todo="Give that lamp of the run file another name.",
        )


def _like(wanted: CandidatesSection, known: list[str], where: str) -> str:
    if not known or (wanted.like is not None and wanted.like not in known):
        raise RunFileError(
            expected=f"a lamp of the run whose kind the candidates are ({', '.join(known) or 'none is lit'})",
            found=f"'{wanted.like}'" if wanted.like else "none",
            where=f"{where}, like under [candidates]",
            todo="Name one of the run's lamps; it shows their shape, spectrum and flux.",
        )
    return wanted.like or known[0]


def _candidates(wanted: CandidatesSection, like: Lamp, room: RunRoom) -> list[Lamp]:
    """Lamps of one kind at every candidate place."""
    if wanted.centers is not None:
        centers = np.array(wanted.centers)
    else:
        assert wanted.spacing is not None  # one of the two
        plan = candidate_grid(room.room.outline, room.room.wall_angle_deg, spacing=wanted.spacing, margin=wanted.margin)
        centers = np.column_stack([plan, np.full(len(plan), like.center[2])])
    return [replace(like, name=f"candidate {number}", center=each) for number, each in enumerate(centers, start=1)]
