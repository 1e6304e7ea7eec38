"""What the trace stage says of its result: how much is missing, and what the user should look at."""

from collections.abc import Mapping
from typing import Any

import xarray as xr

from lidarspectra.radiance.sampling.stated_error import opening_in_words
from lidarspectra.radiance.sampling.transport import MET_BY_CHANCE, SEEN_BY
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.words import two_digits


def truncation_in_words(transport: xr.Dataset) -> str:
    """What is missing beyond the last reflection, where the method estimates it."""
    if "truncated_share" in transport.attrs:
        return f"{100 * transport.attrs['truncated_share']:.2f} % left out beyond the last reflection"
    return "what was left out beyond the last reflection is not estimated"


def glass_notes(left_out_m2: Mapping[str, float]) -> tuple[str, ...]:
    """What is not seen in glass that is in no flat pane (`RadianceScene.left_out_m2`), as full sentences."""
    if "glass" not in left_out_m2:
        return ()
    return (
        f"{left_out_m2['glass']:.2g} m² of glass is curved, in small pieces, or in more panes than are followed: lamps "
        "are not seen reflected in it, so that some 8 % of the light that falls on it is missing, more at a slant. "
        "Light passes through it as it should. Where such glass is large and near a lamp, make it one flat pane.",
    )


def receptor_notes(attributes: Mapping[str, Any]) -> tuple[str, ...]:
    """A note where the sensors of a transport or map have another response than the cosine: they read no irradiance."""
    if SEEN_BY not in attributes:
        return ()
    return (
        f"The sensors see by {attributes[SEEN_BY]}. Irradiance, lx and all that is computed from them are what such "
        "sensors read, not the light that falls there, on a desk, an eye or a solar cell. For that, run the room "
        "without field_of_view_deg and receptor in [sensors].",
    )


def trace_warnings(
    transport: xr.Dataset, points: SensorPoints, left_out_m2: Mapping[str, float] | None = None
) -> tuple[str, ...]:
    """Caveats on a trace, as full sentences; `left_out_m2` as of the scene, if known."""
    said = opening_in_words(transport.attrs)
    warnings = [*receptor_notes(transport.attrs), *([said] if said else [])]
    buried = int(points.buried.sum())
    if buried:
        warnings.append(
            f"{buried} of {len(points)} sensor points are buried in furniture or walls: their values are meaningless, "
            "and they are marked on the maps. Move them into free air if you need them."
        )
    coefficients = transport["coefficient"].to_numpy()
    dark = [
        f"'{name}'" for name, values in zip(transport["lamp"].to_numpy(), coefficients, strict=True) if not values.any()
    ]
    if dark:
        warnings.append(
            f"No light of {', '.join(dark)} reaches any sensor point: it may lie inside a wall or furniture, or behind "
            "one. Look at the floor plan in the report, and correct its place."
        )
    if met := str(transport.attrs.get(MET_BY_CHANCE, "")):
        names = ", ".join(f"'{name}'" for name in met.split("\n"))
        warnings.append(
            f"Sensors of a restricted view have the light straight from {names} as far as rays at random meet it: "
            "where one of these is small and in view, as the sun is, its light may be missing, and the standard error "
            "does not tell. Look at such places with the cosine receptor as well."
        )
    achieved, target = transport.attrs["achieved_relative_se"], transport.attrs["target_relative_se"]
    if achieved > target:
        if transport.attrs.get("method") == "rtrace":
            reason = "because plain rtrace takes a fixed number of rays"
            todo = 'Write a finer noise, or method = "adaptive", in [trace].'
        elif mirror_m2 := (left_out_m2 or {}).get("mirror", 0.0):
            reason = (
                f"because the budget was used up after {transport.attrs['rays']:,} rays: {mirror_m2:.2g} m² of mirror "
                "is curved, rough, in small pieces, or faces other mirrors, and few paths meet a lamp by way of it"
            )
            todo = "Write a coarser noise in [trace], or make that mirror one flat piece."
        else:
            reason = "because the ray budget was used up"
            todo = "Move sensor points there that lie close to a lamp or a mirror, or write a coarser noise in [trace]."
        warnings.append(
            f"The standard error of the simulation is {100 * achieved:.1f} % of the mean, above the target of "
            f"{100 * target:.1f} %, {reason}. The map is right within these larger error "
            f"bars; the report's map of the standard error shows where they are large. {todo}"
        )
    if "missed_target" in transport and (missed := int(transport["missed_target"].sum())):
        warnings.append(
            f"At {missed} of {len(points)} sensor points the standard error is above {100 * target:.1f} % of the light "
            "there, when the budget of paths a point was used up: they lie in the dark, or light reaches them through "
            "a slit. Their values are right within their error bars; the report names them. Write a coarser noise in "
            '[trace], or noise_of = "mean", if such places do not matter.'
        )
    truncated = transport.attrs.get("truncated_share", 0.0)  # plain rtrace does not know it
    if truncated > target:
        warnings.append(
            f"About {two_digits(100 * truncated)} % of the mean irradiance is missing in the worst channel, because "
            f"light is followed for {transport.attrs['bounces']} reflections only and the room is bright; that is more "
            f"than the noise of {100 * target:.1f} % that was asked for. Write accuracy = "
            '"all" in [trace] to follow all of it.'
        )
    slot_error = transport.attrs.get("slot_error", 0.0)  # not in the files of earlier versions
    if slot_error > target:
        warnings.append(
            f"Reflectances and lamps change so much within a channel that its reflected light may be about "
            f"{two_digits(100 * slot_error)} % wrong in the worst channel, although it was traced in parts; that is "
            f"more than the noise of {100 * target:.1f} % that was asked for. Give the sensor narrower channels "
            "(device in [sensors]) if that matters."
        )
    return tuple(warnings)
