"""docs/results-localization.md out of the tables and figures that the experiment left."""

from pathlib import Path

from research.experiments.results_page import Part, write_results_page

PARTS = (
    Part(
        title="Table 4 and Figure 14: learned from a simulation, tested in the true room",
        words="Fingerprints are traced in the virtual phone's scan with estimated materials, at most 2 (low), 8 "
        "(medium) and 14 (high) reflections, of people by lot at each place. The test is of other people in "
        "the room as it truly is, read in whole counts by virtual sensors whose gains, dies and drift nobody told, "
        "as `localize live` would hear them: one at a time they visit all places in an order by lot, stay for 20 to "
        "100 s and are at the next at once; a reading a second, each located by itself, or, 'with memory', with what "
        "those before it told; the reference is the running median over the latest 600 readings, moved along the "
        "trend of the light, by the product's own code. The "
        "median is five minutes old on the average, it is of a room in which there always is somebody, and it drifts "
        "as the sensors do: each die by 1 % an hour (standard deviation), for two hours before. Ten minutes of the "
        "same people's visits go ahead and are not tested. 'measured' learns from a survey: readings of other people "
        "in the true room by the very sensors of the test, five of each, within two hours of an empty room's. On the "
        "map of errors (high, network) a line leads from each place to where its readings are put on the average.",
        tables=(
            "table-4",
            "table-4-goals",
            "paper-table-4",
            "table-4-all",
            "person-effect",
        ),
        figures=("figure-14", "error-map-*"),
    ),
    Part(
        title="How many people to simulate",
        words="This was tried before the test of Table 4, on other people and other sensors: those of the survey, the "
        "first at each place, read by sensors drawn anew. Table 4 uses four in the large office, where eight are "
        "better and cost more, and two in the apartment.",
        tables=("people",),
    ),
    Part(
        title="How old the reference may be",
        words="The virtual sensors' dies drift by 1 % an hour (standard deviation, each for itself). Beside Table 4's "
        "running reference stands one of people who stay longer, with the same window of ten minutes, and readings "
        "that are compared with an empty room: five of each person, at times by lot since it was read.",
        tables=("reference-age",),
    ),
    Part(
        title="Table 5 and Figures 15 and 16: the room has changed",
        words="The apartment. Between T1 and T2 a coffee table, a bookshelf and the dining table with its chairs "
        "moved, the television, a night table and a plant went, the rug is another; the living room's four "
        "lamps got another spectrum and half as much flux again, one of them and one in the bedroom moved, "
        "three others were changed. At T2 people come and go as in Table 4, four at each "
        "place, each at a time of its own. 'raw' compares readings with the empty room of T1, as fingerprints without "
        "a reference do; all else is compared with the running reference of T2.",
        tables=("table-5", "table-5-gains"),
        figures=("figure-15", "figure-16"),
    ),
    Part(
        title="How many sensors suffice",
        words="Sensors added one by one, the one that gains most first (`lidarspectra localize place`). Here each "
        "reading is compared with an empty room of up to two hours before, the survey's and the test's.",
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
        folder, page, title="Results: localization", parts=PARTS, script="python -m research.benchmarks.localization"
    )
