"""How a run's sensors see, and which engine traces for them."""

from contextlib import AbstractContextManager, nullcontext

from lidarspectra.radiance.engine.cluster import cluster_engine
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.sampling.receptors import Receptor, cone_receptor, cosine_receptor, read_receptor
from lidarspectra.workflow.inputs import Inputs


def receptor_of_run(inputs: Inputs) -> Receptor:
    """The sensors' angular response: the cosine, a restricted view, or a measured table."""
    sensors = inputs.room.sensors
    if sensors.receptor is not None:
        return read_receptor(inputs.path(sensors.receptor))
    return cosine_receptor() if sensors.field_of_view_deg is None else cone_receptor(sensors.field_of_view_deg)


def trace_engine(cluster: str | None) -> AbstractContextManager[Engine]:
    """The engine of this machine, or that of a cluster at an address, for the time of a `with` block."""
    return nullcontext(find_engine()) if cluster is None else cluster_engine(cluster)
