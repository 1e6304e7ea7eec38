"""Numbers in sentences for readers."""

COMMAS_FROM = 10_000  # [1]
PLAIN_BELOW = 1e9  # [1] longer numbers are read by their exponent


def digits(value: float, spec: str) -> str:
    """A number as a format says, but large ones without an exponent: 1234.5 by '.3g' is '1230', not '1.23e+03'."""
    text = format(value, spec)
    if not spec.endswith("g") or "e+" not in text or abs(value) >= PLAIN_BELOW:
        return text
    return f"{'+' * text.startswith('+')}{float(text):.0f}"


def two_digits(value: float) -> str:
    """A number to two digits and without an exponent: '260', not '2.6e+02'."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if rounded >= COMMAS_FROM else f"{rounded:.15g}"


def counted(number: int, noun: str) -> str:
    """'1 wall', '2 walls'; 'pass' becomes 'passes'."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun}es" if noun.endswith("s") else f"{number} {noun}s"


def duration_words(seconds: float) -> str:
    """'7.3 minutes', '5.2 hours', '22.5 days'; so that the number has at most three digits before its point."""
    for unit_s, unit, limit_s in ((60.0, "minutes", 2 * 3600.0), (3600.0, "hours", 2 * 86400.0)):
        if seconds < limit_s:
            return f"{seconds / unit_s:.1f} {unit}"
    return f"{seconds / 86400.0:,.1f} days"


def were(number: int, noun: str, verb: tuple[str, str] = ("was", "were")) -> str:
    """'1 row was', '2 rows were'; another verb as ('is', 'are')."""
    return f"{counted(number, noun)} {verb[number != 1]}"
