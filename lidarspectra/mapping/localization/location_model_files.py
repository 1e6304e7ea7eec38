"""A trained locator in a folder: `save_locator(model, folder)`, `load_locator(folder)`.

The folder holds `model.nc` (features, places, the nearest fingerprints, the ridge, the discriminant, and how many
people), `network.onnx`, and `discriminant.onnx`, which is for devices alone.
"""

from dataclasses import asdict
from os import PathLike
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arguments import path_of
from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.mapping.localization.discriminant import DiscriminantPlaces
from lidarspectra.mapping.localization.features import FeatureSettings, FeatureSpace
from lidarspectra.mapping.localization.fingerprint_table import Quantity
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.locators import NearestFingerprints, NetworkPlaces, RidgePlaces
from lidarspectra.mapping.localization.network_graph import discriminant_graph
from lidarspectra.mapping.localization.places import Places
from lidarspectra.mapping.localization.presence import Presence

MODEL_FILE, NETWORK_FILE, DISCRIMINANT_FILE = "model.nc", "network.onnx", "discriminant.onnx"
SCHEMA = "lidarspectra location model 5"
PRESENCE = ("changes", "mean", "scale", "weights", "offset")  # of `Presence`


def save_locator(model: LocationModel, folder: Path) -> Path:
    """Write a model into a folder, which is made where it is not there.

    Raises
    ------
    WorkspaceError
        If it cannot be written.
    """
    settings = {
        name: int(value) if isinstance(value, bool) else value for name, value in asdict(model.space.settings).items()
    }
    dataset = xr.Dataset(
        {
            "usable": (("sensor", "band"), model.space.usable.astype(np.int8)),
            "noise": (("sensor", "band"), model.space.noise),
            "reference": (("sensor", "band"), model.reference),
            "position_m": (("place", "axis"), model.places.positions_m),
            "neighbour_features": (("neighbour", "feature"), model.neighbours.features),
            "neighbour_place": (("neighbour",), model.neighbours.place),
            "ridge_weights": (("feature", "place"), model.ridge.weights),
            "ridge_offset": (("place",), model.ridge.offset),
            "discriminant_weights": (("feature", "place"), model.discriminant.weights),
            "discriminant_offset": (("place",), model.discriminant.offset),
            "presence_changes": (("place", "heard"), model.presence.changes),
            "presence_mean": (("statistic",), model.presence.mean),
            "presence_scale": (("statistic",), model.presence.scale),
            "presence_weights": (("term", "people"), model.presence.weights),
            "presence_offset": (("people",), model.presence.offset),
        },
        coords={
            "sensor": list(model.space.sensors),
            "band": ("band", model.space.bands_nm, {"units": "nm"}),
            "place": list(model.places.labels),
        },
        attrs={"schema": SCHEMA, "quantity": model.quantity, "source": model.source, **settings},
    )
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        # The graphs first: a folder from an interrupted run has no model.nc, and is recognised as incomplete.
        (folder / MODEL_FILE).unlink(missing_ok=True)
        (folder / NETWORK_FILE).write_bytes(model.network.model)
        (folder / DISCRIMINANT_FILE).write_bytes(discriminant_graph(model.discriminant, model.places, model.space))
        write_netcdf(dataset, folder / MODEL_FILE, encoding={})
    return folder


def load_locator(folder: str | PathLike[str]) -> LocationModel:
    """Read a model that `save_locator` wrote.

    Parameters
    ----------
    folder : str or path
        It holds `model.nc` and `network.onnx`.

    Returns
    -------
    model : LocationModel

    Raises
    ------
    MapError
        If the folder lacks a file, or they are no model.
    """
    folder = path_of(folder, name="folder", meaning="the name of a model's folder, as a str or a Path")
    path = folder / MODEL_FILE
    try:
        kept = read_netcdf(path)
        network = (folder / NETWORK_FILE).read_bytes()
        if kept.attrs.get("schema") != SCHEMA:
            raise ValueError(f"schema {kept.attrs.get('schema')!r}")
        quantity: Quantity = "counts" if kept.attrs["quantity"] == "counts" else "irradiance"
        space = FeatureSpace(
            sensors=tuple(kept["sensor"].to_numpy().astype(str).tolist()),
            bands_nm=kept["band"].to_numpy(),
            usable=kept["usable"].to_numpy().astype(np.bool_),
            noise=kept["noise"].to_numpy(),
            settings=FeatureSettings(
                min_count=float(kept.attrs["min_count"]),
                mismatch=float(kept.attrs["mismatch"]),
                remove_level=bool(kept.attrs["remove_level"]),
                per="channel" if kept.attrs["per"] == "channel" else "sensor",
            ),
        )
        places = Places(
            labels=tuple(kept["place"].to_numpy().astype(str).tolist()), positions_m=kept["position_m"].to_numpy()
        )
        neighbours = NearestFingerprints(
            features=kept["neighbour_features"].to_numpy(),
            place=kept["neighbour_place"].to_numpy().astype(np.int64),
            place_count=len(places),
        )
        ridge = RidgePlaces(weights=kept["ridge_weights"].to_numpy(), offset=kept["ridge_offset"].to_numpy())
        discriminant = DiscriminantPlaces(
            weights=kept["discriminant_weights"].to_numpy(), offset=kept["discriminant_offset"].to_numpy()
        )
        presence = Presence(**{name: kept[f"presence_{name}"].to_numpy() for name in PRESENCE})
        reference, source = kept["reference"].to_numpy(), str(kept.attrs["source"])
    except (OSError, ValueError, KeyError) as cause:
        raise MapError(
            expected=f"a folder that 'localize train' wrote, with {MODEL_FILE} and {NETWORK_FILE}",
            found=str(cause),
            where=str(path),
            todo="Train it again.",
        ) from cause
    return LocationModel(
        space=space,
        places=places,
        neighbours=neighbours,
        ridge=ridge,
        discriminant=discriminant,
        network=NetworkPlaces(network, where=str(folder / NETWORK_FILE)),
        presence=presence,
        reference=reference,
        quantity=quantity,
        source=source,
    )
