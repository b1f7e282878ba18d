"""Numbers of a posterior: of the chain and of Laplace's approximation side by side, and where the
two differ.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from html import escape
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from ..film.solve import BlockFlags, PerBlock

LEVELS = (0.05, 0.5, 0.95)
"""Quantiles that are reported; the outer two enclose 90 %."""

Cells: TypeAlias = tuple[list[str], list[list[str]]]
"""Titles and lines of a table, as text."""

AGREES = "agrees"
MEDIANS = "median [5 %, 95 %]"
"""What stands in the cells of a table."""


@dataclass(frozen=True)
class Numbers:
    """Of one quantity, for all blocks, each (blocks,)."""

    mean: PerBlock
    sd: PerBlock
    lower: PerBlock
    median: PerBlock
    upper: PerBlock

    @classmethod
    def of(cls, draws: Float[np.ndarray, "*draws blocks"]) -> "Numbers":
        """From draws, along all leading axes."""
        flat = draws.reshape(-1, draws.shape[-1])
        return cls(flat.mean(axis=0), flat.std(axis=0), *np.quantile(flat, LEVELS, axis=0))


@dataclass(frozen=True)
class Row:
    """One quantity of one block.

    Attributes:
        quantity, block: which.
        mean, sd, lower, median, upper: of the chain, with the 5, 50 and 95 % quantiles; of
            Laplace's approximation where nothing was sampled.
        laplace_mean, laplace_sd, laplace_lower, laplace_upper: of Laplace's approximation.
        effective_samples, autocorrelation_time: of the block's chain, NaN where nothing was
            sampled.
        converged: whether the block's chain is long enough.
        laplace: "agrees", or how the chain differs from it; without a chain whether its own test
            trusts it.
    """

    quantity: str
    block: str
    mean: float
    sd: float
    lower: float
    median: float
    upper: float
    laplace_mean: float
    laplace_sd: float
    laplace_lower: float
    laplace_upper: float
    effective_samples: float
    autocorrelation_time: float
    converged: bool
    laplace: str


class Summary(list[Row]):
    """Rows, a list as any other, which is shown as a table: in a terminal by `print`, in a notebook
    as its last line.

    The table has a line for each quantity, or for each block if there are several, with thickness
    in micrometres and fractions in percent; the rows themselves are in m and in parts of 1.

    Attributes:
        by: what made the chain; empty without one, where all numbers are Laplace's.
    """

    def __init__(self, rows: Iterable[Row], *, by: str) -> None:
        super().__init__(rows)
        self.by = by

    def cells(self) -> Cells:
        """Titles and lines of the table, as text."""
        blocks = list(dict.fromkeys(row.block for row in self))
        return self._by_quantity() if len(blocks) < 2 else self._by_block(blocks)

    def _by_quantity(self) -> Cells:
        titles = (
            [self.by, "sd", "Laplace", "sd", "Laplace"]
            if self.by
            else ["Laplace", "sd", "its own test"]
        )
        lines = []
        for row in self:
            title, scale = in_units(row.quantity)
            line = [
                title,
                interval(row.median, row.lower, row.upper, scale),
                f"{scale * row.sd:.2g}",
            ]
            if self.by:
                ends = f"[{scale * row.laplace_lower:.3g}, {scale * row.laplace_upper:.3g}]"
                line += [ends, f"{scale * row.laplace_sd:.2g}"]
            lines.append([*line, row.laplace])
        return ["", *titles], lines

    def _by_block(self, blocks: list[str]) -> Cells:
        last = ["ESS", "Laplace"] if self.by else ["its own test"]
        quantities = dict.fromkeys(row.quantity for row in self)
        lines = []
        for block in blocks:
            mine = [row for row in self if row.block == block]
            cells = [interval(row.median, row.lower, row.upper) for row in mine]
            differences = dict.fromkeys(row.laplace for row in mine if row.laplace != AGREES)
            samples = [f"{mine[0].effective_samples:.0f}"] if self.by else []
            lines.append(
                [block.removesuffix(" nm"), *cells, *samples, ", ".join(differences) or AGREES]
            )
        return [
            "band",
            *(in_units(quantity)[0] for quantity in quantities),
            *last,
        ], lines

    def __repr__(self) -> str:
        titles, lines = self.cells()
        widths = [max(map(len, column)) for column in zip(titles, *lines, strict=True)]
        # Words stand to the left, figures to the right.
        sides = ["<", *">" * (len(widths) - 2), "<"]
        text = [
            "  ".join(f"{c:{side}{w}}" for c, side, w in zip(cells, sides, widths, strict=True))
            for cells in (titles, *lines)
        ]
        return "\n".join([MEDIANS, *(line.rstrip() for line in text)])

    def _repr_html_(self) -> str:
        def row(cells: list[str], kind: str) -> str:
            return "<tr>" + "".join(f"<{kind}>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"

        titles, lines = self.cells()
        body = "\n".join(row(line, "td") for line in lines)
        return (
            f"<table>\n<caption>{MEDIANS}</caption>\n<thead>{row(titles, 'th')}</thead>\n"
            f"<tbody>\n{body}\n</tbody>\n</table>"
        )


def interval(median: float, lower: float, upper: float, scale: float = 1.0) -> str:
    """A median and its interval, as text."""
    return f"{scale * median:.3g} [{scale * lower:.3g}, {scale * upper:.3g}]"


def in_units(name: str) -> tuple[str, float]:
    """A quantity's title in a picture or a table, and the factor to its unit there."""
    if name.startswith("thickness"):
        return f"{name} (µm)", 1e6
    if name == "model error":
        return "model error (%)", 100.0
    if name.startswith("fraction "):
        return f"{name.removeprefix('fraction ')} (%)", 100.0
    what, at, where = name.partition(" at ")
    symbols = {"absorption": "k d", "scattering": "s d", "ratio": "k/s"}
    return symbols.get(what, what) + at + where, 1.0


def compare(
    sampled: Numbers,
    laplace: Numbers,
    *,
    logarithmic: bool,
    multimodal: BlockFlags,
) -> list[str]:
    """Name the difference between a chain and Laplace's approximation, in a word or two a block.

    Args:
        sampled, laplace: numbers of one quantity.
        logarithmic: compare logarithms; else the quantity lies in [0, 1].
        multimodal: whether the block has more modes than one.
    """
    look = np.log if logarithmic else np.asarray
    tiny = np.finfo(float).tiny if logarithmic else -np.inf
    quantiles = (sampled.lower, sampled.median, sampled.upper, laplace.lower, laplace.upper)
    low, middle, high, other_low, other_high = (look(np.maximum(v, tiny)) for v in quantiles)
    width = np.maximum(high - low, 1e-300)
    off = np.maximum(np.abs(low - other_low), np.abs(high - other_high)) / width
    skew = (high - middle) / np.maximum(middle - low, 1e-300)
    # Ends must agree within this share of the width: half a standard deviation of a Gaussian.
    agree = 0.15
    ends = (sampled.lower < 0.01) | (sampled.upper > 0.99)
    # The first that holds is said.
    cases = {
        AGREES: off <= agree,
        "two modes": multimodal,
        "against a bound": ends & (not logarithmic),
        "skewed": ~((skew >= 1.0 / 1.5) & (skew <= 1.5)),
        "Laplace too wide": other_high - other_low > width * (1.0 + agree),
        "Laplace too narrow": other_high - other_low < width * (1.0 - agree),
    }
    return np.select(list(cases.values()), list(cases), "shifted").tolist()
