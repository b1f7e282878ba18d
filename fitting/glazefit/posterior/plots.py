"""Pictures of a posterior: how its unknowns hang together, and what it says along the spectrum."""

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from glazejax.plots import ABSORPTION, OVER_BLACK, OVER_WHITE, SCATTERING, label_spectra, picture

from .identifiability import only_ratio
from .posterior import Posterior
from .summary import LEVELS, Numbers, in_units

SAMPLED, LAPLACE = "#1f4e9c", "#c8641e"
_COLOURS = {"black": OVER_BLACK, "white": OVER_WHITE}
_RATIO = "#2a6f4b"
_CONTOURS: dict[str, Any] = {"levels": (0.5, 0.9), "smooth": 1.0, "plot_datapoints": False}
_OUTLINES: dict[str, Any] = {"color": LAPLACE, "plot_density": False, "no_fill_contours": True}
# Standard deviations on either side that enclose 90 %.
_NINETY = 1.645


def plot_corner(posterior: Posterior, path: str | Path) -> None:
    """Draw the unknowns of a film against each other, or k d against s d in some bands,
    to a file.
    """
    draw = _corner_of_bands if posterior.problem.kind == "bands" else _corner_of_film
    draw(posterior, path)


def plot_bands(posterior: Posterior, path: str | Path) -> None:
    """Draw what the posterior says along the spectrum, with bands of 90 %, to a file."""
    draw = _optical_bands if posterior.spectra() else _spectra_of_film
    with picture(path, 11, 4.4) as figure:
        left, right = figure.subplots(1, 2)
        title = draw(posterior, left, right)
        left.legend()
        left.set_title(f"{posterior.films[0].name}: {title}")
        right.set_title(_subtitle(posterior))


def _thin(values: Float[np.ndarray, "*draws"]) -> Float[np.ndarray, "n"]:
    flat = values.reshape(-1)
    return flat[:: max(1, flat.size // 40_000)]


def _subtitle(posterior: Posterior) -> str:
    if posterior.chain is None:
        return "Laplace's approximation; nothing was sampled"
    return (
        "the chain has converged"
        if posterior.converged
        else "NOT CONVERGED: the chain is too short"
    )


def _corner_of_film(posterior: Posterior, path: str | Path) -> None:
    import corner

    names = [q.name for q in posterior.problem.quantities if not q.spectrum]
    # Two fractions are one and its complement; of more, each says something.
    binary = sum(n.startswith("fraction ") for n in names) == 2
    if binary or posterior.problem.kind == "stack":
        names = [
            n for n in names if not n.startswith("fraction ") or n in posterior.problem.unknowns
        ]
    titles, units = zip(*map(in_units, names), strict=True)
    draws = np.stack([_thin(posterior.draws[n][..., 0]) for n in names], axis=1) * units
    approximate = np.stack([posterior.laplace_draws[n][:, 0] for n in names], axis=1) * units
    low, high = np.quantile(np.concatenate([draws, approximate]), (0.002, 0.995), axis=0)
    # What never moves has a width too.
    still = np.where(high > low, 0.0, 1e-9)
    side = max(2.0 * len(names) + 1.5, 6.5)
    with picture(path, side, side, layout=None) as figure:
        common: dict[str, Any] = {
            "fig": figure,
            "range": np.transpose([low - still, high + still]),
            "bins": 30,
            **_CONTOURS,
        }
        with warnings.catch_warnings(action="ignore"):
            corner.corner(
                approximate,
                **_OUTLINES,
                weights=np.full(len(approximate), len(draws) / len(approximate)),
                hist_kwargs={"lw": 1.2},
                **common,
            )
            if posterior.chain is not None:
                corner.corner(
                    draws,
                    color=SAMPLED,
                    labels=titles,
                    quantiles=LEVELS,
                    hist_kwargs={"lw": 1.4},
                    **common,
                )
        count = len(names)
        axes = np.array(figure.axes[: count * count]).reshape(count, count)
        for i in range(count):
            low, middle, high = np.quantile(draws[:, i], LEVELS)
            axes[i, i].set_title(f"{titles[i]}\n{middle:.3g}  [{low:.3g}, {high:.3g}]", fontsize=9)
            axes[i, i].set_ylim(0, 1.08 * axes[i, i].dataLim.y1)
            axes[-1, i].set_xlabel(titles[i], fontsize=9)
            if i:
                axes[i, 0].set_ylabel(titles[i], fontsize=9)
        _legend(figure, posterior)


def _legend(figure: Any, posterior: Posterior) -> None:
    from matplotlib.lines import Line2D

    lines = [Line2D([], [], color=LAPLACE, label="Laplace")]
    if posterior.chain is not None:
        lines.insert(0, Line2D([], [], color=SAMPLED, label=posterior.chain.sampler))
    figure.legend(
        handles=lines,
        loc="upper right",
        fontsize=10,
        title=(
            f"{posterior.films[0].name}\nmedian [5 %, 95 %]; contours of 50 and 90 "
            f"%\n{_subtitle(posterior)}"
        ),
        title_fontsize=10,
        alignment="left",
    )


def _corner_of_bands(posterior: Posterior, path: str | Path) -> None:
    """Small panels of k d against s d: bands along the spectrum, and those where Laplace is
    farthest off.
    """
    import corner

    names = ("absorption", "scattering")
    count = len(posterior.problem.blocks)
    spread = np.linspace(0, count - 1, 5).round().astype(int)[1:-1]
    poorest = [b for b in np.argsort(-posterior.laplace.tail) if b not in spread]
    chosen = sorted({*spread, *poorest[: 6 - len(set(spread))]})
    with picture(path, 10.5, 7) as figure:
        panels = figure.subplots(2, 3).ravel()
        for panel, b in zip(panels, chosen, strict=False):
            draws = np.log10([_thin(posterior.draws[n][..., b]) for n in names])
            approximate = np.log10([posterior.laplace_draws[n][:, b] for n in names])
            limits = np.quantile(np.hstack([draws, approximate]), (0.002, 0.998), axis=1).T
            options = {"ax": panel, "bins": 40, "range": limits, **_CONTOURS}
            with warnings.catch_warnings(action="ignore"):
                corner.hist2d(*approximate, **_OUTLINES, **options)
                if posterior.chain is not None:
                    corner.hist2d(*draws, color=SAMPLED, **options)
            tail = posterior.laplace.tail[b]
            panel.set_title(
                f"{posterior.problem.blocks[b]}, Laplace's tail index {tail:.2f}", fontsize=9
            )
            panel.set(xlabel="log10 k d", ylabel="log10 s d")
        for panel in panels[len(chosen) :]:
            panel.set_axis_off()
        figure.suptitle(
            f"{posterior.films[0].name}: contours of 50 and 90 %, the chain blue, Laplace orange; "
            f"{_subtitle(posterior)}",
            fontsize=10,
        )


def _spectra_of_film(posterior: Posterior, spectra: Any, residuals: Any) -> str:
    """Measured and fitted spectra, and their differences compared with what noise and
    model error allow; gives the title of the left panel.
    """
    film = posterior.films[0]
    grid = film.wavelengths
    draws = posterior.flat[:: max(1, len(posterior.flat) // 400)]
    low, middle, high = np.quantile(posterior.problem.readings(draws)[:, 0], LEVELS, axis=0)
    # Standard deviation of a reading by noise, grounds and the median model error.
    errors = posterior.problem.data.expansion
    back = np.linalg.inv(np.asarray(errors.whiten[0]))
    scale = 1.0 + (np.exp(np.median(draws[:, 0, -1])) * np.asarray(errors.spread[0])) ** 2
    allowed = np.sqrt(np.einsum("ij,j,ij->i", back, scale, back)).reshape(film.reflectance.shape)
    for g, ground in enumerate(film.grounds):
        colour = _COLOURS.get(ground, SAMPLED)
        measured = film.reflectance[:, g]
        fit, bound = middle[:, g], _NINETY * allowed[:, g]
        over, thin = f"over {ground}", {"color": colour, "lw": 1}
        spectra.plot(grid, measured, "o", c=colour, ms=4, mfc="none", label=f"{over}, measured")
        spectra.plot(grid, fit, "-", c=colour, lw=1.2, label=f"{over}, median of the fit")
        spectra.fill_between(grid, low[:, g], high[:, g], color=colour, alpha=0.3, lw=0)
        residuals.plot(grid, measured - fit, "o-", ms=3, label=f"{over}: measured - fit", **thin)
        residuals.plot(grid, bound, ":", **thin)
        label = None if g else "90 % by noise and model error"
        residuals.plot(grid, -bound, ":", label=label, **thin)
    noise = _NINETY * film.sd.max(axis=1)
    residuals.fill_between(
        grid,
        -noise,
        noise,
        color="0.6",
        alpha=0.35,
        lw=0,
        label="90 % by the instrument's noise",
    )
    label_spectra(spectra, ylim=(0, 1.25 * max(film.reflectance.max(), high.max())))
    residuals.axhline(0, color="0.7", lw=0.8)
    low, high = residuals.get_ylim()
    label_spectra(residuals, "difference in reflectance", ylim=(low, high + 0.45 * (high - low)))
    residuals.legend(loc="upper left")
    return _mixture(posterior)


def _mixture(posterior: Posterior) -> str:
    amounts = [
        f"{name.removeprefix('fraction ')} {np.median(draws):.1%}"
        for name, draws in posterior.draws.items()
        if name.startswith("fraction ")
    ]
    for name, draws in posterior.draws.items():
        if name.startswith("thickness"):
            coat = name.removeprefix("thickness").removeprefix(" of ")
            amounts.append(f"{coat} {np.median(draws) * 1e6:.3g} µm".strip())
    return ", ".join(amounts)


def _optical_bands(posterior: Posterior, thicknesses: Any, ratios: Any) -> str:
    """k d and s d, and their ratio, with bands of 90 % by the chain and by Laplace; gives the title
    of the left panel.
    """
    grid = posterior.films[0].wavelengths
    drawn = posterior.spectra()
    k, s, ratio = map(Numbers.of, drawn.values())
    approximate = map(Numbers.of, posterior.spectra(laplace=True).values())
    curves = (
        (thicknesses, k, ABSORPTION, "k d"),
        (thicknesses, s, SCATTERING, "s d"),
        (ratios, ratio, _RATIO, "k/s"),
    )
    for (panel, numbers, colour, label), rough in zip(curves, approximate, strict=True):
        panel.plot(grid, numbers.median, "-o", color=colour, ms=3, lw=1.2, label=f"{label}, median")
        panel.fill_between(grid, numbers.lower, numbers.upper, color=colour, alpha=0.25, lw=0)
        if posterior.chain is not None:
            for n, edge in enumerate((rough.lower, rough.upper)):
                panel.plot(
                    grid,
                    edge,
                    "--",
                    color=colour,
                    lw=0.9,
                    label=None if n else f"{label}, 90 % by Laplace",
                )
    low = min(k.median.min(), s.median.min())
    high = max(k.upper.max(), s.upper.max())
    label_spectra(thicknesses, "optical thickness", yscale="log", ylim=(low / 10, high * 2))
    low = ratio.median.min()
    high = ratio.median.max()
    label_spectra(ratios, "k/s", yscale="log", ylim=(low / 3, high * 3))
    # Grey columns.
    edges = np.r_[grid[0], (grid[1:] + grid[:-1]) / 2, grid[-1]]
    for n, b in enumerate(np.flatnonzero(only_ratio(drawn))):
        label = None if n else "only k/s is known"
        thicknesses.axvspan(edges[b], edges[b + 1], color="0.88", lw=0, zorder=0, label=label)
    ratios.legend()
    return "bands of 90 %"
