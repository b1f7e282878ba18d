"""Which samples of a source may be learnt from, and which are tests of mixtures: frozen tables.

    python -m benchmarks.paintbench.splits

prints whether the tables in `splits` are those whose hashes stand next to them, and whether they
follow the rule: a mixture is a test where the SHA-256 of its source, paints and fractions is odd, so
that readings of one recipe stand together; layers are tests; pure paints and controls are not.
"""

import csv
import hashlib
from pathlib import Path

from .sources import SPLITS, Sample

HASHES = SPLITS / "hashes.tsv"


def is_test(source: str, sample: Sample) -> bool:
    """The rule by which the tables were made."""
    if sample.kind != "mixture":
        return sample.kind == "layers"
    fractions = " ".join(f"{part:.3f}" for part in sample.fractions)
    recipe = f"{source}: {' + '.join(sample.paints)}: {fractions}"
    return hashlib.sha256(recipe.encode()).digest()[-1] % 2 == 1


def check_hashes() -> None:
    """Refuse tables that are not the frozen ones.

    Raises:
        SystemExit: names the table.
    """
    for name, wanted in listed_hashes().items():
        found = hash_of(SPLITS / name)
        if found != wanted:
            raise SystemExit(
                f"{SPLITS / name} is not the frozen table: its SHA-256 is {found}, {HASHES.name} "
                f"has {wanted}"
            )


def listed_hashes() -> dict[str, str]:
    """Table -> SHA-256, as it was frozen."""
    with HASHES.open(newline="", encoding="utf-8") as file:
        return {row["table"]: row["sha256"] for row in csv.DictReader(file, delimiter="\t")}


def hash_of(path: Path) -> str:
    """SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    check_hashes()
    print(f"{len(listed_hashes())} tables are as they were frozen")
