"""The one error of the extension: what was expected, what was found, where, and what to do."""


class ExtensionError(Exception):
    """What the user sees in Blender's status bar.

    Parameters
    ----------
    expected, found : str
        As parts of a sentence.
    where : str
        File, object or setting.
    todo : str
        What to do about it, as a sentence.
    """

    def __init__(self, *, expected: str, found: str, where: str, todo: str = "") -> None:
        advice = f" {todo}" if todo else ""
        super().__init__(f"{where}: expected {expected}, found {found}.{advice}")
