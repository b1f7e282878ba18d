"""What OpenPBR keeps of a glaze: parameters fitted to ten stacks, compared with parameters written
without a fit.

    python -m benchmarks.render.openpbr_fit

The truth is the solver at all pairs of angles, in linear RGB. Errors are those of
`glazejax.appearance.exports`: albedo under an even sky, CIEDE2000 under the sky and under a lamp at
45 degrees, and the RMS of the reflectance factor.
"""

from typing import Any

import jax
import numpy as np

import glazejax as gj
from benchmarks.results import Results, command_line, ends, quantities, quantity
from benchmarks.timing import time_call
from glazejax.appearance.exports import angular_colour, fit_openpbr
from glazejax.appearance.exports.openpbr import reflectance_factor
from glazejax.appearance.exports.rgb import rgb_of_xyz
from glazejax.appearance.exports.spaces import LAYERINGS, Layering
from glazejax.appearance.glaze.table import glaze_table
from glazejax.colour import encoded_srgb
from glazejax.paint.describe import name_paints, parse_coats
from glazejax.stacks import Stack, all_paints

NEEDS = ("matplotlib",)

STACKS: tuple[tuple[str, tuple[str, float, float]], ...] = (
    ("ultramarine 1 um on white", ("UltramarineBlue:1um", 0.9, 1.5)),
    ("ultramarine 3 um over zinc white", ("UltramarineBlue:3um,ZincWhite:20um", 0.9, 1.5)),
    ("eosin 2 um on white", ("Eosin:2um", 0.9, 1.5)),
    ("viridian 4 um over chrome yellow", ("ViridianGreen:4um,ChromeYellow:20um", 0.9, 1.5)),
    ("cochineal 10 um over vermilion", ("Cochineal:10um,Vermillion:20um", 0.9, 1.5)),
    ("zinc white 100 um", ("ZincWhite:100um", 0.9, 1.5)),
    ("chrome yellow 50 um", ("ChromeYellow:50um", 0.9, 1.5)),
    ("bone black 30 um", ("BoneBlack:30um", 0.9, 1.5)),
    ("zinc white 3 um on a dark ground", ("ZincWhite:3um", 0.05, 1.5)),
    ("cobalt blue 5 um on grey, index 1.6", ("CobaltBlue:5um", 0.4, 1.6)),
)
"""Name, coats, ground and refractive index of each stack."""


def glaze(coats: str, ground: float, index: float) -> gj.Glaze:
    """A stack of the table."""
    return Stack(name_paints(parse_coats(coats), all_paints()), (), ground, index).glaze()


def main() -> None:
    options = command_line(__doc__).parse_args()
    jax.config.update("jax_enable_x64", True)
    results = Results("openpbr_fit", options.out)
    _smooth(results)
    _rough(results)
    results.save(_figure())


def _smooth(out: Results) -> None:
    """All stacks under a smooth surface."""
    rows: dict[str, dict[str, Any]] = {}
    seconds = []
    for name, stack in STACKS:
        truth = angular_colour(glaze(*stack), space="acescg")
        rows[name] = {}
        for layering in LAYERINGS:
            fit, taken = time_call(lambda t=truth, how=layering: fit_openpbr(t, layering=how))
            rows[name][layering] = fit
            seconds.append(taken)
    out(
        "OpenPBR against the solver, smooth surface, ACEScg, D65\n"
        "naive: base_color as seen straight on, index as it is; fit: least squares over all "
        "pairs of angles\n"
        "albedo: largest error of what an even sky shows; dE: CIEDE2000, mean over 0 to 75 degrees\n"
        "\nfit for MaterialX's node graph (without a coat, the same in any program that takes "
        "albedo from the eye's side)\n"
        f"{'':37}{'albedo':>15}{'dE, sky':>15}{'dE, lamp at 45':>17}{'RMS of R':>17}"
    )
    out(f"{'stack':37}" + f"{'naive':>8}{'fit':>7}" * 2 + f"{'naive':>10}{'fit':>7}" * 2)
    for name, fits in rows.items():
        one, plain = fits["materialx"].errors, fits["materialx"].naive_errors
        out(
            f"{name:37}{plain.albedo:8.4f}{one.albedo:7.4f}{plain.sky:8.2f}{one.sky:7.2f}"
            f"{plain.lamp:10.2f}{one.lamp:7.2f}{plain.rms:10.4f}{one.rms:7.4f}"
        )
    _gains(out, rows)
    out(
        "\nother ways to put layers together, each fitted (coat where it makes the error smaller)\n"
        f"{'':37}{'specification':^28}{'reciprocal':^28}"
    )
    out(f"{'stack':37}" + f"{'coat':>5}{'dE, sky':>8}{'lamp':>6}{'RMS':>8} " * 2)
    for name, fits in rows.items():
        line = f"{name:37}"
        for layering in LAYERINGS[1:]:
            fit = fits[layering]
            coat = "yes" if fit.material.coat_weight else "no"
            line += f"{coat:>5}{fit.errors.sky:8.2f}{fit.errors.lamp:6.2f}{fit.errors.rms:8.4f} "
        out(line)
    out()
    for layering in LAYERINGS[1:]:
        ratio = [fits["materialx"].errors.rms / fits[layering].errors.rms for fits in rows.values()]
        least, middle, most = _spread(ratio)
        out(f"RMS of materialx over {layering}: {least:.2f} to {most:.2f}, median {middle:.2f}")
        if layering == "reciprocal":
            out.record(
                reciprocal_least=quantity(least, "times", 1),
                reciprocal_most=quantity(most, "times", 1, form="s"),
                reciprocal=quantity(middle, "times", 0, n=len(rows)),
            )
    errors = [fits["materialx"].errors for fits in rows.values()]
    _record_errors(out, "", errors)
    for key, name in (("eosin", "eosin 2 um on white"), ("white", "zinc white 100 um")):
        fit = rows[name]["materialx"]
        lamp = {f"{key}_lamp_naive": fit.naive_errors.lamp, f"{key}_lamp_fit": fit.errors.lamp}
        out.record(**quantities(lamp))
    glazes = [rows[name]["reciprocal"].errors.rms for name in GLAZES]
    out.record(rms_most=quantity(max(one.rms for one in errors), digits=2))
    out.record(reciprocal_glaze=quantity(max(glazes), digits=4))
    _, middle, most = _spread(seconds)
    out(f"a fit takes {middle:.2f} s (median), {most:.2f} s (most), angles computed")


def _spread(values: list[float]) -> tuple[float, float, float]:
    """Least, median and largest."""
    return min(values), float(np.median(values)), max(values)


def _record_errors(out: Results, key: str, errors: list) -> None:
    for what in ("sky", "lamp"):
        values = ends(f"{key}{what}", (getattr(one, what) for one in errors))
        out.record(**quantities(values, digits=1, n=len(errors)))


def _rough(out: Results) -> None:
    """Some stacks under a rough surface."""
    out(
        "\na rough surface (alpha of GGX), the body by glazejax.radiative.rough: fits for "
        "materialx and for reciprocal"
    )
    out(f"{'stack':37}{'alpha':>6}" + f"{'albedo':>9}{'dE, sky':>8}{'lamp':>6}{'RMS':>8}" * 2)
    errors: dict[Layering, list] = {"materialx": [], "reciprocal": []}
    for number in DRAWN:
        name, stack = STACKS[number]
        for alpha in (0.1, 0.3):
            truth = angular_colour(glaze(*stack), roughness=alpha, space="acescg")
            line = f"{name:37}{alpha:6g}"
            for layering, row in errors.items():
                e = fit_openpbr(truth, layering=layering).errors
                row.append(e)
                line += f"{e.albedo:9.4f}{e.sky:8.2f}{e.lamp:6.2f}{e.rms:8.4f}"
            out(line)
    for key, row in zip(("rough", "rough_reciprocal"), errors.values(), strict=True):
        _record_errors(out, f"{key}_", row)


def _gains(out: Results, rows: dict[str, dict[str, Any]]) -> None:
    """How much smaller errors are with a fit."""
    for what in ("albedo", "sky", "lamp", "rms"):
        ratio = [
            getattr(fits["materialx"].naive_errors, what) / getattr(fits["materialx"].errors, what)
            for fits in rows.values()
        ]
        least, middle, most = _spread(ratio)
        out(f"naive over fit, {what}: {least:.2f} to {most:.2f}, median {middle:.2f}")
        if what in ("albedo", "sky"):
            out.record(**quantities(ends(f"gain_{what}", ratio), "times", 1, n=len(ratio)))
        if what == "lamp":
            out.record(gain_lamp=quantity(middle, "times", 1, n=len(ratio)))


GLAZES = ("ultramarine 1 um on white", "eosin 2 um on white")
"""Absorbing glazes on white."""
DRAWN = (1, 5)
"""Stacks of the picture."""
_SIDE = 240
_LAMP = np.array([0.0, np.sin(np.deg2rad(50)), np.cos(np.deg2rad(50))])
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def _figure():
    """Spheres, their left half the truth, and what is seen of a lamp against the eye's angle."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 5.6), layout="constrained")
    axes = figure.subplots(2, 4, width_ratios=(1, 1, 1, 1.6))
    words = (
        "Left half of each sphere: computed. Right half: OpenPBR. A lamp 50° above the eye, "
        "without the gloss."
    )
    figure.suptitle(words, fontsize=10)
    for row, number in zip(axes, DRAWN, strict=True):
        name, stack = STACKS[number]
        made = glaze(*stack)
        table, grid = glaze_table(made, made.wavelengths, tolerance=1e-4), made.wavelengths
        weights, white = gj.colour.colour_weights(grid), gj.colour.white_point(grid)

        def truth(cos_in, cos_out, table=table, weights=weights, white=white):
            spectra = np.asarray(table.reflectance_factor(cos_in, cos_out), float)
            return rgb_of_xyz(spectra @ weights, white, "lin_rec709")

        colour = angular_colour(made)
        fits = {
            layering: fit_openpbr(colour, layering=layering, coat=layering == "reciprocal")
            for layering in LAYERINGS
        }
        shown = {
            "not fitted": (fits["materialx"].naive, "materialx"),
            "fitted, MaterialX": (fits["materialx"].material, "materialx"),
            "fitted, reciprocal layers": (fits["reciprocal"].material, "reciprocal"),
        }
        for axis, (title, (material, layering)) in zip(row, shown.items(), strict=False):
            axis.imshow(_sphere(truth, material, layering))
            axis.set_title(title, fontsize=9)
            axis.set_axis_off()
        turned = {"rotation": 90, "va": "center", "ha": "right", "fontsize": 9}
        row[0].text(-0.02, 0.5, name, transform=row[0].transAxes, **turned)
        _curves(row[3], truth, shown)
    return figure


def _sphere(truth, material, layering):
    """Encoded sRGB of a sphere under a lamp 50 degrees above the eye; right of the middle it is
    OpenPBR.
    """
    y, x = np.mgrid[1 : -1 : _SIDE * 1j, -1 : 1 : _SIDE * 1j]
    z = np.sqrt(np.maximum(0.0, 1.0 - x**2 - y**2))
    cos_in, cos_out = _LAMP[1] * y + _LAMP[2] * z, z
    picture = np.ones((_SIDE, _SIDE, 3))
    inside = x**2 + y**2 < 1
    picture[inside] = 0.02
    lit = inside & (cos_in > 0.01) & (cos_out > 0.01)
    between = (_LAMP[2] - cos_in * cos_out) / np.sqrt(
        np.maximum((1 - cos_in**2) * (1 - cos_out**2), 1e-12)
    )
    azimuth = 180.0 - np.rad2deg(np.arccos(np.clip(between, -1, 1)))
    for half, function in (
        (lit & (x < 0), lambda a, b, t: truth(a, b)),
        (
            lit & (x >= 0),
            lambda a, b, t: reflectance_factor(material, a, b, t, layering=layering, gloss=False),
        ),
    ):
        seen = function(cos_in[half], cos_out[half], azimuth[half])
        picture[half] = np.clip(seen * cos_in[half][:, None], 0, 1)
    return np.where(inside[..., None], encoded_srgb(picture), 1.0)


def _curves(axis, truth, shown):
    """Luminance factor against the eye's angle, for a lamp straight above and at 75 degrees."""
    angles = np.linspace(0, 85, 60)
    cosines = np.cos(np.deg2rad(angles))
    for lamp, style in ((0.0, "-"), (75.0, "--")):
        cos_in = np.full(angles.shape, np.cos(np.deg2rad(lamp)))
        words = "computed, lamp straight above" if lamp == 0 else "computed, lamp at 75°"
        axis.plot(
            angles, truth(cos_in, cosines) @ _LUMINANCE, style, color="0.6", lw=3.5, label=words
        )
        for (title, (material, layering)), colour in zip(
            shown.items(), ("C3", "C0", "C2"), strict=True
        ):
            seen = (
                reflectance_factor(material, cos_in, cosines, layering=layering, gloss=False)
                @ _LUMINANCE
            )
            axis.plot(angles, seen, style, color=colour, lw=1.2, label=title if lamp == 0 else None)
    axis.set_xlabel("eye, degrees from the normal", fontsize=8)
    axis.set_ylabel("luminance factor of the body", fontsize=8)
    axis.set_ylim(0)
    axis.tick_params(labelsize=7)
    axis.legend(fontsize=6.5, frameon=False, loc="lower left")


if __name__ == "__main__":
    main()
