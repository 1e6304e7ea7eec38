"""Text that every document may hold. Apart from the style of figures, so that tables need no drawing library."""

import unicodedata


def printable(text: str) -> str:
    """A text without the control characters that no document may hold; line ends and tabs stay."""
    return "".join(letter for letter in text if letter in "\n\t" or unicodedata.category(letter) not in ("Cc", "Cs"))
