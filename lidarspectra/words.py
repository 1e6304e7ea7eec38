"""Numbers in sentences for readers."""


def counted(number: int, noun: str) -> str:
    """'1 wall', '2 walls'; 'pass' becomes 'passes'."""
    if number == 1:
        return f"1 {noun}"
    return f"{number} {noun}es" if noun.endswith("s") else f"{number} {noun}s"


def were(number: int, noun: str, verb: tuple[str, str] = ("was", "were")) -> str:
    """'1 row was', '2 rows were'; another verb as ('is', 'are')."""
    return f"{counted(number, noun)} {verb[number != 1]}"
