"""Reports of recoveries and predictions: lines and tables on the screen, and the tables that go
into files.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float
from rich.console import RenderableType
from rich.text import Text

from glazejax import colour
from glazejax.paint.describe import format_length
from glazejax.plots import hex_colour
from glazejax.report import plain_table, swatch
from glazejax.spectra import Bands, ranges

from ..coats.coats import CoatPrediction, CoatRecovery
from ..films.result import RELATIVE_LIMIT, RULE, Recovery
from ..joint.joint import UNIT
from ..joint.result import JOINT_RULE, JointRecovery
from ..predict.crossvalidation import LeftOut
from ..predict.mixture import is_another
from ..predict.prediction import Prediction, mean_part_errors, say_paint_errors

Table: TypeAlias = tuple[Sequence[str], Iterable[Sequence[object]]]
"""Titles of columns, and rows."""


def spectra_rows(
    labels: Sequence[str], wavelengths: Bands, *columns: Bands, form: str
) -> Iterator[Sequence[str]]:
    """A row for each wavelength: the labels, the wavelength, and a number of each column in this
    form.
    """
    for wavelength, *values in zip(wavelengths, *columns, strict=True):
        yield *labels, f"{wavelength:g}", *(f"{value:{form}}" for value in values)


def report_films(recovery: Recovery, seconds: float, first: float) -> Iterator[RenderableType]:
    """A line a paint: how well it is met, and what is known of it.

    Args:
        recovery: recovered films.
        seconds: the recovery took.
        first: seconds until the first chunk was done, with what was compiled for it.
    """
    title = (
        f"{len(recovery)} paints in {seconds:.1f} s ({first:.1f} s to compile and do the first few)"
    )
    table = plain_table("paint", "RMSE", "ΔE00 D65", "ΔE00 A", "gloss", "k, s known", title=title)
    d65 = recovery.delta_e("D65")
    a = recovery.delta_e("A")
    names = recovery.films.names
    grid = recovery.films.wavelengths
    for row, name in enumerate(names):
        table.add_row(
            name,
            f"{recovery.rmse[row]:.5f}",
            _difference(d65[row]),
            _difference(a[row]),
            "1" if recovery.gloss[row] == 1 else f"{recovery.gloss[row]:.2f}",
            f"{recovery.identifiable[row].sum()}/{grid.size} bands",
        )
    yield table
    if not recovery.identifiable.all():
        yield "Too opaque to separate k from s, only k/s is known:"
        for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
            where = ranges(grid, ~recovery.identifiable[row])
            yield f"  {names[row]}: {where}: k/s {_ratios(recovery, row)}"
    yield Text(f"Rule: {RULE}.", "dim")
    if (recovery.gloss < 1).any():
        yield Text(
            "Gloss below 1: the film reads less than a smooth surface reflects; that share "
            "of it was counted.",
            "dim",
        )
    faults = {
        "the solver did not settle at": ~recovery.converged & (recovery.misfit > 9),
        "no k and s meet both spectra within 4 standard deviations at": recovery.misfit > 16,
    }
    for words, flags in faults.items():
        for row in np.flatnonzero(flags.any(axis=1)):
            yield Text(f"{names[row]}: {words} {ranges(grid, flags[row])}.", "yellow")


def _difference(value: float, digits: int = 2) -> str:
    """Colour difference; a dash where the bands give no colour."""
    return "-" if np.isnan(value) else f"{value:.{digits}f}"


def _ratios(recovery: Recovery, row: int) -> str:
    """Range of k/s, with errors, over the bands where only that is known."""
    bands = np.flatnonzero(~recovery.identifiable[row])
    ratio = recovery.ratio[row]
    sd = recovery.ratio_sd[row]
    ends = [bands[np.argmin(ratio[bands])], bands[np.argmax(ratio[bands])]]
    return " to ".join(_with_error(ratio[b], sd[b]) for b in dict.fromkeys(ends))


def _with_error(value: float, sd: float) -> str:
    """Value and error with as many digits as the error has; a lower bound where it is no better
    known.
    """
    if sd > value / 2:
        return f"above {max(value - 2 * sd, 0.2 * value):.1g}"
    digits = max(0, 1 - int(np.floor(np.log10(sd))))
    return f"{value:.{digits}f}±{sd:.{digits}f}"


def fit_table(recovery: Recovery) -> Table:
    """Ratio k/s and fitted spectra, a line a paint and wavelength; none needs a thickness."""
    header = (
        "pigment",
        "wavelength_nm",
        "ratio",
        "ratio_sd",
        "fitted_over_black",
        "fitted_over_white",
    )
    columns = [recovery.ratio, recovery.ratio_sd, recovery.fitted_black, recovery.fitted_white]
    grid = recovery.films.wavelengths
    rows = (
        row
        for film, name in enumerate(recovery.films.names)
        for row in spectra_rows([name], grid, *(column[film] for column in columns), form=".6g")
    )
    return header, rows


def report_joint(recovery: JointRecovery, seconds: float) -> Iterator[RenderableType]:
    """A line a paint, and what holds for all films."""
    sd = np.median(recovery.log_sd, axis=2)
    ratio = np.median(recovery.log_ratio_sd, axis=1)
    bands = recovery.wavelengths.size
    title = f"{len(recovery.paints)} paints from {len(recovery.films)} films in {seconds:.1f} s"
    table = plain_table(
        "paint", "films", "error of k", "of s", "of k/s", "k, s separable", title=title
    )
    for row, paint in enumerate(recovery.paints):
        table.add_row(
            paint,
            f"{(recovery.shares[:, row] > 0).sum()}",
            *(_per_cent(value) for value in (*sd[:, row], ratio[row])),
            f"{recovery.identifiable[row].sum()}/{bands} bands",
        )
    yield table
    yield Text(f"Errors: median over the bands, one standard deviation. Rule: {JOINT_RULE}.", "dim")
    for row in np.flatnonzero(~recovery.identifiable.all(axis=1)).tolist():
        unknown = recovery.log_sd[:, row] > RELATIVE_LIMIT
        where = [
            f"{name} at {ranges(recovery.wavelengths, bands)}"
            for name, bands in zip("ks", unknown, strict=True)
            if bands.any()
        ]
        remark = f"not known to {RELATIVE_LIMIT:.0%}: {'; '.join(where)}"
        yield (
            f"  {recovery.paints[row]}: {remark if where else 'in no mixture: its scale is open'}"
        )
    difference = recovery.delta_e()
    # Without a colour the spectra say how well films are met.
    measure, off, digits = "ΔE00 (D65, 10°)", difference, 2
    if np.isnan(difference).any():
        measure, off, digits = "RMSE", recovery.rmse[:, None], 5
    yield (
        f"Fitted films: {measure} {off.mean():.{digits}f} on average, {off.max():.{digits}f} at "
        f"most ({recovery.films.names[int(off.max(axis=1).argmax())]}); gloss of the films from "
        f"{recovery.gloss.min():.2f} to {recovery.gloss.max():.2f}."
    )
    # Films of known recipes are met to 2.3 at most (the samples).
    if difference.max() > 5.0:
        yield Text(
            "No paint of these recipes reads so: do not rely on predictions of this "
            "fit. Are rows swapped, or films called by another paint's name?",
            "yellow",
        )
    # Films whose weights the fit wants changed much.
    for film, errors in enumerate(recovery.unknowns.films[:, 2:]):
        order = np.argsort(-recovery.shares[film])
        for index, error in enumerate(errors):
            # So much is worth a second look at the recipe.
            if abs(error) > 0.3:
                yield Text(
                    f"{recovery.films.names[film]}: reads as if it held {np.exp(error):.2g} times "
                    f"the {recovery.paints[order[1 + index]]} that its recipe says.",
                    "yellow",
                )
    if not recovery.converged:
        yield Text(f"The solver did not settle in {recovery.steps} steps.", "yellow")


def _per_cent(log_sd: float) -> str:
    return f"{log_sd:.0%}" if log_sd < 1 else f"factor {np.exp(log_sd):.1f}"


def film_table(recovery: JointRecovery) -> Table:
    """Thickness, gloss and errors of weights that the fit says of each film, and how well it is
    met.
    """
    difference = recovery.delta_e()
    rows = (
        (
            name,
            describe_recipe(recovery, row),
            f"{recovery.thickness[row]:.4g}",
            f"{recovery.thickness_sd[row]:.2g}",
            f"{recovery.gloss[row]:.3f}",
            " ".join(
                f"{np.exp(error):.3f}" for error in recovery.unknowns.films[row, 2:] if error != 0
            )
            or "1",
            f"{recovery.rmse[row]:.5f}",
            *_over_cards(difference[row], recovery.films.seen[row] & ~np.isnan(difference[row])),
        )
        for row, name in enumerate(recovery.films.names)
    )
    header = (
        "film",
        "recipe",
        "relative_thickness",
        "relative_thickness_sd",
        "gloss",
        "weight_error",
        "rmse",
        "delta_e_black",
        "delta_e_white",
    )
    return header, rows


def describe_recipe(recovery: JointRecovery, row: int) -> str:
    """Paints of a film and the share of each, such as "Red 40% + White 60%"."""
    return " + ".join(
        f"{paint} {100 * share:.3g}%" for paint, share in recovery.recipe(row).items()
    )


def report_coats(
    recovery: CoatRecovery, predictions: Sequence[CoatPrediction], seconds: float
) -> Iterator[RenderableType]:
    """A line a paint, and what is predicted of each."""
    title = (
        f"{len(recovery.paints)} paints from {len(recovery.films)} films of coats in "
        f"{seconds:.1f} s"
    )
    table = plain_table("paint", "coats", "s d of one coat", "met to", title=title)
    for paint, fit in recovery.paints.items():
        coats = ", ".join(f"{recovery.coats[name]:g}" for name in fit.films.names)
        scattering = recovery.scattering(paint)
        table.add_row(
            paint,
            coats,
            f"{np.exp(scattering.mean):.2g} ×÷ {np.exp(scattering.sd):.2g}",
            f"ΔE00 {_difference(fit.delta_e().mean(), 1)}",
        )
    yield table
    yield Text(
        "s d: scattering times thickness of one coat, mean over the bands, × or ÷ one "
        "standard deviation.",
        "dim",
    )
    for prediction in predictions:
        if np.isnan(recovery.paints[prediction.paint].delta_e()).any():
            continue
        thickest = recovery.thickest(prediction.paint)
        change = float(prediction.delta_e(thickest.reflectance))
        yield (
            f"{prediction.paint}, {prediction.coats:g} coats on the ground of {thickest.name!r}: "
            f"ΔE00 {change:.1f} from that film, predicted to "
            f"ΔE00 {prediction.expected_error():.1f}."
        )
    yield Text.assemble(
        f"Films of equal coats may differ in thickness by {np.expm1(recovery.spread):.0%}. ",
        ("The unit is a typical coat: no length was measured.", "bold"),
    )
    for paint, fit in recovery.paints.items():
        if not fit.converged:
            yield Text(f"{paint}: the solver did not settle in {fit.steps} steps.", "yellow")


def coat_table(recovery: CoatRecovery) -> Table:
    """Thickness of each film, and how well it is met."""
    rows = (
        (
            name,
            paint,
            f"{recovery.coats[name]:g}",
            f"{fit.thickness[row]:.4g}",
            f"{fit.thickness_sd[row]:.2g}",
            f"{fit.rmse[row]:.5f}",
            "" if np.isnan(difference) else f"{difference:.3f}",
        )
        for paint, fit in recovery.paints.items()
        for row, (name, difference) in enumerate(
            zip(fit.films.names, fit.delta_e().mean(axis=1), strict=True)
        )
    )
    header = (
        "film",
        "paint",
        "coats",
        "relative_thickness",
        "relative_thickness_sd",
        "rmse",
        "delta_e",
    )
    return header, rows


def next_coat_table(predictions: Sequence[CoatPrediction]) -> Table:
    """Each film that was predicted, a line a wavelength."""
    rows = (
        row
        for prediction in predictions
        for row in spectra_rows(
            [prediction.paint, f"{prediction.coats:g}"],
            prediction.wavelengths,
            prediction.reflectance,
            *prediction.interval(),
            form=".5f",
        )
    )
    return ("paint", "coats", "wavelength_nm", "reflectance", "low_90", "high_90"), rows


def report_left_out(out: LeftOut) -> Iterator[RenderableType]:
    """Say how well films that were left out of the fit were predicted by the others."""
    off = out.predicted.mean(axis=1)
    farthest = int(off.argmax())
    yield (
        f"Left out in turn and predicted from their recipes, {len(out.names)} mixtures: ΔE00 "
        f"(D65, 10°) {off.mean():.2f} on average, median {np.median(off):.2f}, {off[farthest]:.2f} "
        f"at most ({out.names[farthest]}); {out.inside.mean():.0%} of the readings lie in the 90 % "
        "bands."
    )
    errors = mean_part_errors(out.predictions)
    yield (
        f"What they were expected to be off, ΔE00 {out.expected.mean():.1f} on average, comes "
        f"from the film ({errors['film']:.1f}, as the other films left out show), from the scale "
        f"of its paints ({errors['scale']:.1f}) and from the shape of their k and s "
        f"({errors['paint']:.1f}). Two mixings of one recipe differ by about ΔE00 "
        f"{np.mean([prediction.between_mixings() for prediction in out.predictions]):.1f}."
    )
    unsteady = {p: chance for p, chance in out.variation.unsteady.items() if chance >= 0.5}
    if unsteady:
        listed = ", ".join(f"{paint} ({chance:.0%})" for paint, chance in unsteady.items())
        yield (
            "Films of these paints are probably twice as far from their recipes as films are on "
            f"average; such paint fades, stains or is hard to weigh: {listed}. Behind each, how "
            "probable that is."
        )
    if not out.complete:
        yield Text("Interrupted: the mixtures that follow were not left out.", "yellow")


def left_out_table(recovery: JointRecovery, out: LeftOut) -> Table:
    """Colour differences of each film as the others predict it, and as they were expected."""
    rows = (
        (
            name,
            describe_recipe(recovery, recovery.films.names.index(name)),
            *_over_cards(out.predicted[i], out.films.seen[i]),
            f"{out.expected[i]:.3f}",
            f"{out.inside[i]:.3f}",
            *_over_cards(out.fitted[i], out.films.seen[i]),
        )
        for i, name in enumerate(out.names)
    )
    header = (
        "film",
        "recipe",
        "delta_e_black",
        "delta_e_white",
        "delta_e_expected",
        "inside_90_percent_band",
        "delta_e_fitted_black",
        "delta_e_fitted_white",
    )
    return header, rows


def _over_cards(values: Float[np.ndarray, "2"], cards: Bool[np.ndarray, "2"]) -> tuple[str, ...]:
    """Fields of a number over black and over white, empty where nothing was read."""
    return tuple(f"{value:.3f}" if read else "" for value, read in zip(values, cards, strict=True))


def report_reading(
    calibrated: JointRecovery,
    before: Sequence[Prediction],
    after: Sequence[Prediction],
    eye: tuple[str, str],
) -> Iterator[RenderableType]:
    """Lines on what a reading of a mixture shows, and how much it takes from the error of
    predictions.
    """
    film = calibrated.films
    fit = calibrated.delta_e(*eye)[0][film.seen[0]]
    thick = (
        "opaque"
        if film.opaque[0]
        else format_length(float(f"{calibrated.thickness[0] * UNIT:.3g}"))
    )
    first, then = (
        np.mean([p.expected_error(*eye) for p in predictions]) for predictions in (before, after)
    )
    yield (
        f"Reading {film.names[0]}: met to ΔE00 {fit.mean():.2f}; thickness {thick}, on the scale "
        f"of these paints. Expected error of the films below: ΔE00 {first:.1f} without the "
        f"reading, {then:.1f} with it."
    )
    if not calibrated.converged:
        yield Text("The fit of the reading did not settle; take what follows as rough.", "yellow")
    # Farther off, the mixture may be another one.
    if fit.max() > 2.0:
        yield Text(
            f"The reading is met no nearer than ΔE00 {fit.max():.1f}: is the mixture as stated?",
            "yellow",
        )
    elif is_another(calibrated):
        yield Text(
            "The reading is met, but by k and s that this mixture hardly has: is it as "
            "stated? What follows holds only if it is.",
            "yellow",
        )


def report_predictions(
    predictions: Sequence[Prediction], eye: tuple[str, str], *, anew: bool
) -> Iterator[RenderableType]:
    """A table of colours, and what they are expected to be off; where no mixing was read, also by
    how much two of them differ.
    """
    table = plain_table("film", "over", "", "L*", "a*", "b*", "expected ΔE00", words=(0, 1, 2))
    for prediction in predictions:
        off = prediction.expected_errors(*eye)
        for card, spectrum in enumerate(prediction.reflectance):
            lab = np.asarray(
                colour.lab(prediction.wavelengths, spectrum, illuminant=eye[0], observer=eye[1])
            )
            rgb = colour.srgb(prediction.wavelengths, spectrum, illuminant=eye[0], observer=eye[1])
            name = prediction.name if card == 0 else ""
            table.add_row(
                name,
                ("black", "white")[card],
                swatch(hex_colour(rgb)),
                *(f"{v:.1f}" for v in lab),
                f"{off[card]:.1f}",
            )
    yield table
    if anew:
        mixture = "+".join(predictions[0].paints)
        next_one = np.mean([prediction.between_mixings(*eye) for prediction in predictions])
        yield (
            f"Two mixings of {mixture} differ by about ΔE00 {next_one:.1f}. The paints are not "
            f"known exactly either: that adds {say_paint_errors(predictions, eye)}."
        )
        yield Text("A reading of one film of it narrows that: --reading FILE.", "dim")


def prediction_table(predictions: Sequence[Prediction]) -> Table:
    """Reflectance of each film over both cards with its 90 % intervals, a line a wavelength."""
    rows = (
        row
        for prediction in predictions
        for over, *columns in zip(
            ("black", "white"), prediction.reflectance, *prediction.interval(), strict=True
        )
        for row in spectra_rows(
            [prediction.name, over], prediction.wavelengths, *columns, form=".6f"
        )
    )
    return ("film", "over", "wavelength_nm", "reflectance", "lower_90", "upper_90"), rows
