"""Tables as CSV text."""

import numpy as np
import pandas as pd

TIME_COLUMN = "unix_s"


def csv_text(frame: pd.DataFrame, *, digits: int = 9) -> str:
    """A table as CSV, its numbers with so many significant digits, and times since 1970 to the millisecond.

    Nine digits of a time since 1970 end at tens of seconds.

    Parameters
    ----------
    frame : pandas.DataFrame
        Its column `unix_s`, if there is one, holds times. [s]
    digits : int
        Of other numbers.
    """
    if TIME_COLUMN in frame:
        times = frame[TIME_COLUMN].to_numpy(np.float64)
        words = [np.format_float_positional(time, precision=3, trim="-") if np.isfinite(time) else "" for time in times]
        frame = frame.assign(**{TIME_COLUMN: words})
    return str(frame.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\n"))
