"""`lidarspectra localize train | test | score | live | place`."""

import math
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from lidarspectra.cli.interruption import until_interrupted
from lidarspectra.cli.progress import progress_bar
from lidarspectra.cli.terminal import console, print_note, say, shown
from lidarspectra.words import counted

if TYPE_CHECKING:
    from lidarspectra.hardware.sensor.as7265x import SensorSettings
    from lidarspectra.mapping.localization.location_model import TrainingSettings
    from lidarspectra.workflow.applications.localization_jobs import LocationReport

app = typer.Typer(no_args_is_help=True, help="Find where a person stands from the readings of fixed spectral sensors.")

ModelArgument = Annotated[
    Path, typer.Argument(metavar="MODEL_DIR", help="Folder that 'train' wrote.", show_default=False)
]
PositionsOption = Annotated[
    Path | None,
    typer.Option("--positions", metavar="FILE.csv", help="Positions of the places: name, x, y and optionally z (m)."),
]
MinCountOption = Annotated[
    float, typer.Option("--min-count", min=0.0, help="Leave out channels whose reference count is below this.")
]
EachAloneOption = Annotated[
    bool, typer.Option("--each-alone", help="Locate each reading by itself, without what those before it told.")
]
MethodName = Literal["together", "network", "discriminant", "neighbours", "ridge"]
NO_FIX_NOTE = (
    "No position was found: the sources ended before the running median had its first {first} frames."
    " Give more readings, a smaller --first, or readings of the empty room with --empty."
)


@app.command()
def train(
    fingerprints: Annotated[
        list[Path],
        typer.Argument(
            metavar="FINGERPRINTS...", help="Output of 'fingerprints', or CSV of readings.", show_default=False
        ),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="MODEL_DIR", help="Folder for the model.", show_default=False)],
    positions: PositionsOption = None,
    min_count: MinCountOption = 10.0,
    gain: Annotated[float | None, typer.Option("--gain", help="Gain of the sensors: 1, 3.7, 16 or 64.")] = None,
    integration: Annotated[
        float | None, typer.Option("--integration", metavar="MS", help="Their integration time, 2.8 to 714 ms.")
    ] = None,
    copies: Annotated[int, typer.Option("--copies", min=1, help="Random readings made from each fingerprint.")] = 20,
    drift: Annotated[
        float,
        typer.Option(
            "--drift", metavar="PERCENT", min=0.0, help="Drift of a sensor's reading since its reference was taken."
        ),
    ] = 0.3,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Random seed.")] = 0,
) -> None:
    """Train a model on fingerprints, simulated or measured."""
    from lidarspectra.cli.sensor_options import settings_given
    from lidarspectra.workflow.applications.localization_jobs import train_from_files

    device = settings_given(gain, integration)
    settings = _training_settings(min_count, copies=copies, drift=drift / 100.0, seed=seed, device=device)
    with progress_bar("") as report:
        model, notes = train_from_files(
            fingerprints, out, positions=positions, settings=settings, seed=seed, progress=report
        )
    usable = model.space.usable
    console.print(
        f"{counted(len(model.places), 'place')}, {counted(len(model.space.sensors), 'sensor')}, {usable.sum()} of "
        f"{usable.size} channels bright enough, a feature for each {model.space.per}; saved in {out}",
        soft_wrap=True,
    )
    for note in notes:
        print_note(note)


@app.command("test")
def try_model(
    model: ModelArgument,
    readings: Annotated[
        list[Path], typer.Argument(metavar="READINGS...", help="Labelled readings.", show_default=False)
    ],
    positions: PositionsOption = None,
    against: Annotated[
        Literal["own", "running", "trained"],
        typer.Option(
            "--against",
            help="Reference: the readings' own empty room or median, the running median that 'live' uses, or"
            " the one from training.",
        ),
    ] = "own",
    each_alone: EachAloneOption = False,
    run: Annotated[
        Path | None, typer.Option("--run", metavar="RUN", help="A run whose walls and furniture are drawn.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="DIR", help="Default: MODEL_DIR/test.")] = None,
) -> None:
    """Evaluate a model on labelled readings: percentiles, cumulative curve and map of errors, top-k."""
    from lidarspectra.workflow.applications.localization_jobs import errors_from_files

    found = errors_from_files(
        model, readings, out or model / "test", positions=positions, against=against, each_alone=each_alone, run=run
    )
    _show(found)


@app.command()
def score(
    nights: Annotated[
        list[Path], typer.Argument(metavar="NIGHT...", help="Labelled readings in order of time.", show_default=False)
    ],
    positions: PositionsOption = None,
    min_count: MinCountOption = 10.0,
    each_alone: EachAloneOption = False,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the tables.")] = Path(
        "localization-score"
    ),
) -> None:
    """Train and test within each measured night, split in time, and from every night to every other."""
    from lidarspectra.workflow.applications.localization_jobs import score_nights

    with progress_bar("") as report:
        found = score_nights(
            nights,
            out,
            positions=positions,
            settings=_training_settings(min_count),
            each_alone=each_alone,
            progress=report,
        )
    _show(found)


@app.command()
def live(
    model: ModelArgument,
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE",
            help="PORT of a hub or its recorded FILE; or SENSOR=PORT or SENSOR=LOG for each sensor.",
            show_default=False,
        ),
    ],
    empty: Annotated[
        Path | None, typer.Option("--empty", metavar="FILE", help="Readings of the empty room, the reference.")
    ] = None,
    method: Annotated[MethodName, typer.Option("--method", help="Estimator.")] = "together",
    period: Annotated[float, typer.Option("--period", metavar="S", min=0.01, help="Time between frames.")] = 1.0,
    max_age: Annotated[float, typer.Option("--max-age", metavar="S", min=0.01, help="Ignore older readings.")] = 5,
    window: Annotated[
        int, typer.Option("--window", min=1, help="Frames in the running median; used without --empty.")
    ] = 600,
    first: Annotated[
        int | None,
        typer.Option("--first", min=1, help="Frames before the first result. Default: 60, or --window if smaller."),
    ] = None,
    each_alone: EachAloneOption = False,
    always_one: Annotated[
        bool, typer.Option("--always-one", help="One person is there: never answer 'nobody' or 'two people'.")
    ] = False,
    frames: Annotated[int | None, typer.Option("--frames", min=1, help="Stop after this many frames.")] = None,
    baud: Annotated[int | None, typer.Option("--baud", help="Baud rate. Default: 115200.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE.csv", help="Write the track to this file.")] = None,
) -> None:
    """Print where a person stands, or that nobody or two people are there, until Ctrl-C or a recording's end."""
    from lidarspectra.errors import MapError
    from lidarspectra.io.files import writing
    from lidarspectra.mapping.localization.live import LiveSettings
    from lidarspectra.mapping.localization.running_reference import FIRST_FRAMES, MedianWindow
    from lidarspectra.workflow.applications.localization_jobs import TRACK_COLUMNS, follow, live_frames, track_row

    median = MedianWindow(frames=window, first=min(FIRST_FRAMES, window) if first is None else first)
    settings = LiveSettings(method=method, window=median, each_alone=each_alone, always_one=always_one)
    count = 0
    with ExitStack() as closing, until_interrupted() as stopped:
        track = None
        if out is not None:  # row by row: a night's track is not lost at its end; an old one stays until the first fix
            closing.enter_context(writing(out, error=MapError))
            track = closing.enter_context(out.open("a", encoding="utf-8", newline="\n"))
        given = live_frames(sources, period_s=period, max_age_s=max_age, stop=stopped, baud=baud, on_note=print_note)
        for fix in follow(model, given, settings=settings, empty=empty):
            count += 1
            x, y = fix.position_m
            where = f"  ({x:.2f}, {y:.2f}) ± {fix.spread_m:.2f} m" if math.isfinite(x) else ""
            line = f"{fix.time_s:.1f} s  {fix.label}  {100 * fix.probability:.0f} %{where}"
            say(line)
            if track is not None:
                if count == 1:
                    track.truncate(0)
                    track.write(",".join(TRACK_COLUMNS) + "\n")
                track.write(track_row(fix))
                track.flush()
            if stopped() or count == frames:
                break
    if not count:
        print_note(NO_FIX_NOTE.format(first=median.first))
    elif out is not None:
        say(f"Track: {out}")


@app.command()
def place(
    source: Annotated[
        Path,
        typer.Argument(
            metavar="FINGERPRINTS|RUN",
            help="FINGERPRINTS: places that localize best. RUN: places that rebuild the map best.",
            show_default=False,
        ),
    ],
    count: Annotated[
        int | None, typer.Option("--count", min=1, help="Sensors to choose. Default: 8, or all if there are fewer.")
    ] = None,
    positions: PositionsOption = None,
    lamp_spread: Annotated[
        float, typer.Option("--lamp-spread", min=0.0, help="RUN: relative uncertainty of a lamp's flux.")
    ] = 0.1,
    error: Annotated[float, typer.Option("--error", min=0.0, help="RUN: relative error of the map.")] = 0.1,
    length: Annotated[
        float, typer.Option("--length", metavar="M", min=0.01, help="RUN: correlation length of that error.")
    ] = 1.0,
    noise: Annotated[float, typer.Option("--noise", min=1e-4, help="RUN: relative noise of a reading.")] = 0.02,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Folder for the table and the curve.")] = Path(
        "sensor-places"
    ),
) -> None:
    """Choose sensor places one after the other, each time the best one (greedy); the curve shows how many suffice."""
    from lidarspectra.workflow.applications.localization_jobs import MapDoubts, place_to_locate, place_to_rebuild

    if source.is_dir():
        doubts = MapDoubts(lamp_spread=lamp_spread, error=error, length_m=length, noise=noise)
        _show(place_to_rebuild(source, count, out, doubts))
    else:
        _show(place_to_locate(source, count, out, positions=positions))


def _training_settings(
    min_count: float,
    *,
    copies: int = 20,
    drift: float = 0.003,
    seed: int = 0,
    device: "SensorSettings | None" = None,
) -> "TrainingSettings":
    from lidarspectra.mapping.localization.augmentation import Augmentation
    from lidarspectra.mapping.localization.features import FeatureSettings
    from lidarspectra.mapping.localization.location_model import TrainingSettings
    from lidarspectra.mapping.localization.locators import NetworkSettings

    return TrainingSettings(
        features=FeatureSettings(min_count=min_count),
        augmentation=Augmentation(copies=copies, drift=drift),
        network=NetworkSettings(seed=seed),
        device=device,
    )


def _show(report: "LocationReport") -> None:
    for table in report.tables:
        if table is report.tables[0] or table.name == "people":
            console.print(shown(table))
    for note in report.notes:
        print_note(note)
    say(f"Tables and figures: {report.folder}")
