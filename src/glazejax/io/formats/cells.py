"""Cells of a workbook by calamine, in a process of its own: a damaged file may take all memory, or
end the process that reads it.
"""

import io
import json
import subprocess
import sys

MOST_CELLS = 5_000_000
"""Of a sheet, those that are empty between others among them."""
# What a reader may take, in bytes.
_MEMORY = 2 << 30


def read_cells(content: bytes, sheet: str) -> tuple[list[str], list[list[str]] | None]:
    """Names of the sheets with cells, and the rows of one as text without the empty cells at their
    ends; None where there is no such sheet, or one of too many cells.

    Args:
        content: of the workbook.
        sheet: its name; empty for the first.

    Raises:
        ValueError: it is no workbook, or not a whole one.
    """
    # As a file by itself: the package would be imported first.
    done = subprocess.run(
        [sys.executable, "-P", __file__, sheet], input=content, capture_output=True, check=False
    )
    if done.returncode:
        raise ValueError("not a whole workbook")
    names, rows = json.loads(done.stdout)
    return names, rows


def _extract(content: bytes, sheet: str) -> tuple[list[str], list[list[str]] | None]:
    from python_calamine import CalamineWorkbook, SheetTypeEnum

    book = CalamineWorkbook.from_filelike(io.BytesIO(content))
    names = [page.name for page in book.sheets_metadata if page.typ == SheetTypeEnum.WorkSheet]
    name = sheet or "".join(names[:1])
    if name not in names:
        return names, None
    page = book.get_sheet_by_name(name)
    if page.total_height * page.total_width > MOST_CELLS:
        return names, None
    rows = []
    for row in page.iter_rows():
        words = [_words(cell) for cell in row]
        while words and not words[-1]:
            words.pop()
        rows.append(words)
    return names, rows


def _words(cell: object) -> str:
    # All numbers of a workbook are floats.
    words = str(cell).removesuffix(".0") if isinstance(cell, float) else str(cell)
    return " ".join(words.split())


def _limit_memory() -> None:
    # Other systems have no such limit, or count as memory what no program uses.
    if sys.platform == "linux":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        if not 0 <= most <= _MEMORY:
            resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, most))


if __name__ == "__main__":
    _limit_memory()
    json.dump(_extract(sys.stdin.buffer.read(), sys.argv[1]), sys.stdout)
