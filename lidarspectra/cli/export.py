"""`lidarspectra export RUN [--glb] [--usdz] [--vtk] [--blender]`: the lit room for other programs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarspectra.cli.terminal import say

if TYPE_CHECKING:
    from lidarspectra.workflow.applications.export_of_run import Kind


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A finished run folder.", show_default=False)],
    glb: Annotated[bool, typer.Option("--glb", help="The room in false colour as GLB.")] = False,
    usdz: Annotated[bool, typer.Option("--usdz", help="The same as USDZ, for iPhones; needs the extra 'usd'.")] = False,
    vtk: Annotated[bool, typer.Option("--vtk", help="Map and surfaces with all numbers as VTK (.vtu).")] = False,
    blender: Annotated[
        bool, typer.Option("--blender", help="room.npz: what the Blender extension loads, each lamp's light apart.")
    ] = False,
    quantity: Annotated[
        str | None,
        typer.Option(
            "--quantity",
            metavar="NAME",
            help="In false colour: illuminance_lx, melanopic_edi_lx, ... or a channel, 560.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: RUN/export.")] = None,
) -> None:
    """Write the lit room for a phone's AR viewer (GLB, USDZ), for ParaView (VTK) and for the Blender extension.

    Without --glb, --usdz, --vtk or --blender: GLB and VTK.
    """
    from lidarspectra.workflow.applications.export_of_run import export_run

    wanted: dict[Kind, bool] = {"glb": glb, "usdz": usdz, "vtk": vtk, "blender": blender}
    kinds = [kind for kind, is_wanted in wanted.items() if is_wanted] or ["glb", "vtk"]
    for path in export_run(run, kinds, quantity=quantity, out=out or run / "export"):
        say(str(path))
