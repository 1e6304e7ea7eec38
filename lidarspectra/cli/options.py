"""Arguments that several commands on a run file share."""

from pathlib import Path
from typing import Annotated

import typer

RunFileArgument = Annotated[Path, typer.Argument(metavar="ROOM.toml", help="The run file.", show_default=False)]
OutOption = Annotated[
    Path | None, typer.Option("--out", metavar="RUN", help="The run folder. Default: NAME.run beside NAME.toml.")
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", min=1, max=1024, help="Number of processes. Default: one per core.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="tcp://HOST:PORT",
        help="Trace on the workers of a Dask scheduler: its address or JSON file.",
    ),
]
