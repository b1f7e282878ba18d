"""Tables of cases in words."""


def rows(text: str) -> list[list[str]]:
    """A case a line, its cells between bars."""
    return [[cell.strip() for cell in line.split("|")] for line in text.strip("\n").splitlines()]
