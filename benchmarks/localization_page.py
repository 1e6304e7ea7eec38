"""docs/results-localization.md out of the tables and figures that the experiment left."""

from pathlib import Path

from lidarspectra.mapping.evaluation.results_page import Part, write_results_page

PARTS = (
    Part(
        title="Table 4 and Figure 14: learned from a simulation, tested in the true room",
        words="Fingerprints are traced in the virtual phone's scan with estimated materials, at most 2 (low), 8 "
        "(medium) and 14 (high) reflections, of people by lot at each place. The test is of other people in "
        "the room as it truly is, read in whole counts by virtual sensors whose gains, dies and drift nobody "
        "told. 'measured' learns from such readings of other people in the true room. On the map of errors "
        "(high, network) a line leads from each place to where its readings are put on the average.",
        tables=("table-4", "paper-table-4", "table-4-all", "person-effect"),
        figures=("figure-14", "error-map-*"),
    ),
    Part(
        title="How old the reference may be",
        words="The virtual sensors' dies drift by 1 % an hour (standard deviation, each for itself) after the empty"
        " room was read; Table 4 lets up to two hours pass. A running median, as `localize live` takes it, is"
        " minutes old.",
        tables=("reference-age",),
    ),
    Part(
        title="Table 5 and Figures 15 and 16: the room has changed",
        words="The apartment. Between T1 and T2 a coffee table, a bookshelf and the dining table with its chairs "
        "moved, the television, a night table and a plant went, the rug is another; the living room's four "
        "lamps got another spectrum and half as much flux again, one of them and one in the bedroom moved, "
        "three others were changed. 'raw' compares readings at T2 with the empty room of T1, as fingerprints "
        "without a reference do; 'ratio' takes the empty room anew at T2, which costs one minute with nobody "
        "in the room.",
        tables=("table-5",),
        figures=("figure-15", "figure-16"),
    ),
    Part(
        title="How many sensors suffice",
        words="Sensors added one by one, the one that gains most first (`lidarspectra localize place`).",
        tables=("placement-*",),
    ),
    Part(
        title="A measured night",
        words="27 sensors of the paper's authors, 3008 readings of one person at 43 places; it is not part of the "
        "package.",
        tables=("nights",),
    ),
)


def write_page(folder: Path, page: Path) -> Path:
    """Compose the page from what lies in a folder; see `write_results_page`."""
    return write_results_page(
        folder, page, title="Results: localization", parts=PARTS, script="python -m benchmarks.localization"
    )
