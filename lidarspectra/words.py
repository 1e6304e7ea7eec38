"""Numbers in sentences for readers."""

COMMAS_FROM = 10_000  # [1]


def two_digits(value: float) -> str:
    """A number to two digits and without an exponent: '260', not '2.6e+02'."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if rounded >= COMMAS_FROM else f"{rounded:.15g}"


def counted(number: int, noun: str) -> str:
    """'1 wall', '2 walls'; 'pass' becomes 'passes'."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun}es" if noun.endswith("s") else f"{number} {noun}s"


def were(number: int, noun: str, verb: tuple[str, str] = ("was", "were")) -> str:
    """'1 row was', '2 rows were'; another verb as ('is', 'are')."""
    return f"{counted(number, noun)} {verb[number != 1]}"
