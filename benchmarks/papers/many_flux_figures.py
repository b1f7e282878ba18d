"""Paper C's figures 3 to 10 drawn, its numbers next to ours.

    python -m benchmarks.papers.many_flux_figures

The paper draws figures 3 and 4 in two dimensions and does not print their albedo and phase
function, nor those of figures 5 to 7; what is taken here stands in the titles. Everything is in
three dimensions, in the plane of incidence.
"""

import argparse
from typing import TYPE_CHECKING

import jax
import numpy as np

from benchmarks.papers.many_flux_example import GROUND, INDEX, PRINTED, Example, compute
from benchmarks.papers.many_flux_paths import (
    ALBEDO,
    AZIMUTH,
    COSINES,
    INCIDENCE,
    PATHS,
    SECTORS,
    THICKNESS,
    G,
    lobe_by_fluxes,
    lobe_by_paths,
    off,
)
from benchmarks.results import Results, add_option, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEEDS = ("matplotlib",)

BLUE, ORANGE, GREEN, RED, GREY = "#0072b2", "#d55e00", "#009e73", "#cc3366", "0.45"
COLOURS = (BLUE, ORANGE, GREEN, RED, "#8060b0")
ANGLES = np.linspace(-88.0, 88.0, 89)


def lobe(axes: "Axes", angles: np.ndarray, values: np.ndarray, *, up: bool, **style) -> None:
    """A distribution over angles (degrees, from the normal) as a line at its values from the
    origin.
    """
    sign = 1.0 if up else -1.0
    x, y = np.sin(np.deg2rad(angles)), sign * np.cos(np.deg2rad(angles))
    axes.plot(values * x, values * y, **style)


def finish(axes: "Axes", title: str) -> None:
    """Equal scales, a line for the surface, no frame."""
    axes.axhline(0.0, color=GREY, linewidth=0.8, zorder=0)
    axes.set_aspect("equal")
    axes.set_title(title, loc="left", fontsize=10)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)


def arrow(axes: "Axes", angle: float, size: float) -> None:
    """Light that comes from above at an angle."""
    x, y = -np.sin(np.deg2rad(angle)) * size, np.cos(np.deg2rad(angle)) * size
    axes.annotate(
        "",
        xy=(0, 0),
        xytext=(x, y),
        arrowprops={"arrowstyle": "->", "color": GREY, "linewidth": 1.2},
        zorder=0,
    )
    axes.plot([x], [y], alpha=0.0)  # the arrow lies within the limits


def draw_modes_and_depths(out: Results) -> "Figure":
    """Figures 3 and 4."""
    from matplotlib.figure import Figure

    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.field import manyflux_field

    figure = Figure(figsize=(13, 8.5), layout="constrained")
    panels = figure.subplots(2, 4)
    rays, both, decay = mode_shapes()
    # Blue: positive, orange: negative parts of an eigenvector.
    out(
        "Figure 3: from even to directed. Share of a mode's light within 30 degrees of its "
        "strongest direction:"
    )
    shown = (0, 1, 2, 5)
    shares = []
    for axes, mode in zip(panels[0], shown, strict=True):
        shape = both[mode] / both[mode][np.argmax(np.abs(both[mode]))]
        for part, style in ((np.maximum(shape, 0.0), BLUE), (np.maximum(-shape, 0.0), ORANGE)):
            for side in (-1.0, 1.0):
                axes.plot(side * part * np.sin(rays), -part * np.cos(rays), color=style)
        axes.set(xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))
        finish(axes, f"3: eigenvector {mode + 1}, decay {decay[mode]:.3f}")
        weight = np.abs(shape) * np.sin(rays)
        near = np.abs(rays - rays[np.argmax(np.abs(shape))]) < np.deg2rad(30)
        shares.append(float(np.trapezoid(weight * near, rays) / np.trapezoid(weight, rays)))
    out(
        "  "
        + ", ".join(f"eigenvector {m + 1}: {s:.2f}" for m, s in zip(shown, shares, strict=True))
    )
    cosines, azimuth = np.cos(np.deg2rad(ANGLES)), [0.0]
    field = manyflux_field(
        [ALBEDO],
        [10.0],
        0.0,
        depth=[0.0, 1.0, 5.0],
        cos_direction=cosines,
        azimuth=azimuth,
        phase=henyey_greenstein(G),
        refractive_index=1.0,
    )
    out("Figure 4: normal incidence. Flux downwards and upwards, and what is left of the beam:")
    for axes, depth, k in zip(panels[1], ("0", "1", "5"), range(3), strict=False):
        lobe(
            axes, ANGLES, np.asarray(field.down[k, :, 0]), up=False, color=ORANGE, label="downwards"
        )
        lobe(axes, ANGLES, np.asarray(field.up[k, :, 0]), up=True, color=BLUE, label="upwards")
        size = 1.1 * float(max(np.max(field.down[k]), np.max(field.up[k])))
        axes.set(xlim=(-size, size), ylim=(-size, size))
        finish(axes, f"4: z = {depth}/sigma_t, beam {float(field.beam[k]):.3f}")
        out(
            f"  z = {depth}/sigma_t: {field.flux_down[k]:.4f}, {field.flux_up[k]:.4f}, "
            f"{field.beam[k]:.4f}"
        )
    panels[1][0].legend(frameon=False, fontsize=8, loc="lower center")
    panels[1][3].set_visible(False)
    figure.suptitle(
        f"Paper C, figures 3 (orange: negative) and 4: albedo {ALBEDO}, g = {G}, light from "
        "above, pi L/E",
        fontsize=12,
    )
    return figure


def mode_shapes() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles from the downward normal (radians), radiance of each mode over them, decays per
    optical depth.
    """
    import jax.numpy as jnp

    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.bordered import Diagonal
    from glazejax.radiative.manyflux.directions import Spread, spread_directions
    from glazejax.radiative.manyflux.eigenmodes import layer_modes
    from glazejax.radiative.manyflux.scattering import associated_legendre, rates, scattering

    rule = spread_directions(1.0, Spread(32, 0, -1.0))
    mu, weights = jnp.asarray(rule.cosines), jnp.asarray(rule.weights)
    nothing = mu[:0]
    terms = 48
    tables = [associated_legendre(c, 1, terms) for c in (mu, nothing, nothing)]
    even, odd = scattering(
        henyey_greenstein(G, terms), tables[0], tables[1], tables[2], jnp.sqrt(weights)
    )
    a, b = (
        x.core[0] for x in rates(jnp.asarray([ALBEDO]), even, odd, Diagonal(mu, nothing, nothing))
    )
    modes = layer_modes(a, b)
    kappa = np.sqrt(np.asarray(modes.decay_squared))
    total = np.asarray(modes.shapes)
    difference = np.asarray(b) @ total / kappa
    root = np.sqrt(np.asarray(mu * weights))[:, None]
    down, up = (total + difference) / root, (total - difference) / root
    angle = np.arccos(np.asarray(mu))
    # Cosines descend, so that angles ascend: downwards, then upwards from grazing on.
    return np.concatenate([angle, np.pi - angle[::-1]]), np.concatenate([down, up[::-1]]).T, kappa


def draw_paths(out: Results) -> "Figure":
    """Figure 5."""
    from matplotlib.figure import Figure

    lit = float(np.cos(np.deg2rad(INCIDENCE)))
    paths = lobe_by_paths(lit, PATHS)
    fluxes = lobe_by_fluxes(np.array([lit]), AZIMUTH, tolerance=1e-7)[:, 0]
    figure = Figure(figsize=(7, 4.6), layout="constrained")
    axes = figure.subplots()
    angles = np.rad2deg(np.arccos(COSINES))
    half = SECTORS // 2
    for side, sector in ((1.0, 0), (-1.0, half)):
        label = f"{PATHS:,} paths" if side > 0 else None
        style = {
            "color": ORANGE,
            "marker": "o",
            "markersize": 4,
            "linestyle": "none",
            "label": label,
        }
        lobe(axes, side * angles, paths[:, sector], up=True, **style)
    plane = np.concatenate([-angles[::-1], angles])
    values = np.concatenate([fluxes[::-1, half], fluxes[:, 0]])
    lobe(axes, plane, values, up=True, color=BLUE, label="many fluxes")
    arrow(axes, INCIDENCE, 0.75 * float(values.max()))
    finish(
        axes, f"5: light that comes back, albedo {ALBEDO}, g = {G}, thickness {THICKNESS:g}/sigma_t"
    )
    axes.legend(frameon=False, fontsize=9)
    out(
        f"Figure 5: {PATHS:,} paths and many fluxes differ by {off(paths, fluxes):.1%} (rms over "
        "rms); times: many_flux_claims.txt"
    )
    return figure


def draw_lobes(out: Results) -> "Figure":
    """Figures 6 and 7."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 6.5), layout="constrained")
    panels = figure.subplots(1, 2)
    albedos, cosines_g = (0.2, 0.4, 0.6, 0.8, 1.0), (-0.5, -0.25, 0.0, 0.25, 0.5)
    fixed = [np.full(5, 0.0), np.full(5, 0.8)]
    for axes, q, g, name in (
        (panels[0], np.array(albedos), fixed[0], "albedo"),
        (panels[1], fixed[1], np.array(cosines_g), "g"),
    ):
        up, down = both_lobes(q, g)
        values = albedos if name == "albedo" else cosines_g
        for k, value in enumerate(values):
            lobe(axes, ANGLES, up[k], up=True, color=COLOURS[k], label=f"{name} = {value:g}")
            lobe(axes, ANGLES, down[k], up=False, color=COLOURS[k])
        arrow(axes, INCIDENCE, 0.7 * float(max(up.max(), down.max())))
        axes.legend(frameon=False, fontsize=8)
        if name == "albedo":
            finish(axes, "6: albedo, isotropic scattering")
            shapes = up / up.mean(axis=1, keepdims=True)
            change = np.max(np.abs(shapes[1:4] / shapes[-1] - 1))
            out(
                "Figure 6: from albedo 1 to .4 the light that comes back falls to "
                f"{up[1].mean() / up[-1].mean():.2f}"
            )
            out(
                f"  its shape changes by at most {100 * change:.0f} % (paper: less strong, "
                "hardly another shape)"
            )
        else:
            finish(axes, "7: mean cosine g, albedo .8")
            back, mirror = (int(np.argmin(np.abs(ANGLES - a))) for a in (-INCIDENCE, INCIDENCE))
            ratios = ", ".join(
                f"g = {v:g}: {up[k, back] / up[k, mirror]:.2f}" for k, v in enumerate(values)
            )
            out(
                f"Figure 7: towards the light over the mirror direction: {ratios} (paper: g < 0 "
                "sends light back)"
            )
    figure.suptitle(
        "Paper C, figures 6 and 7: one layer of thickness 1/sigma_t, light from 45 degrees, pi L/E"
    )
    return figure


def both_lobes(albedo: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reflected and transmitted factors of layers, (layers, angles)."""
    from glazejax.radiative.common.phase import henyey_greenstein
    from glazejax.radiative.manyflux.free import free_factor

    found = [
        free_factor(
            albedo[:, None, None],
            np.ones((1, 1, 1)),
            transmitted=transmitted,
            phase=henyey_greenstein(g, 24)[:, None, None],
            refractive_index=1.0,
            cos_incidence=float(np.cos(np.deg2rad(INCIDENCE))),
            cos_viewing=np.cos(np.deg2rad(ANGLES)),
            azimuth=np.where(ANGLES < 0, 180.0, 0.0),
            tolerance=1e-4,
        )
        for transmitted in (False, True)
    ]
    return np.asarray(found[0]), np.asarray(found[1])


def draw_joined(found: Example, out: Results) -> "Figure":
    """Figures 8, 9 and 10."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15, 7.5), layout="constrained")
    panels = figure.subplots(2, 4)
    draw_scheme(panels[0][0])
    surface, paint, ground, joined = panels[0][1], panels[0][2], panels[0][3], panels[1][0]
    # What a smooth surface does to a beam: two lines as long as their shares.
    beams = np.deg2rad(INCIDENCE), np.arcsin(np.sin(np.deg2rad(INCIDENCE)) / INDEX)
    shares = found.fresnel_outside, 1.0 - found.fresnel_outside
    for share, beam, sign, colour in zip(shares, beams, (1.0, -1.0), (BLUE, ORANGE), strict=True):
        surface.plot(
            [0, share * np.sin(beam)], [0, sign * share * np.cos(beam)], color=colour, linewidth=2.5
        )
    arrow(surface, INCIDENCE, 1.0)
    finish(surface, "9a: the surface, shares of the flux")
    lobe(paint, found.angles, found.layer_up, up=True, color=BLUE)
    lobe(paint, found.angles, found.layer_down, up=False, color=ORANGE)
    finish(paint, "9b: the paint alone, inside")
    lobe(ground, np.linspace(-90, 90, 91), np.full(91, GROUND), up=True, color=BLUE)
    finish(ground, "9c: the ground")
    lobe(joined, found.angles, found.joined, up=True, color=BLUE)
    arrow(joined, INCIDENCE, float(found.joined.max()))
    finish(joined, "9d: all joined")
    out(f"Figure 9a: the surface reflects {found.fresnel_outside:.4f} at 45 degrees from outside,")
    out(
        f"  {found.fresnel_inside:.3f} from inside (paper: about .1); Kubelka-Munk's R "
        f"{found.kubelka_munk:.4f} (.26)"
    )
    titles = ("10a: surface and paint, exact", "10b: order 0", "order 1")
    for axes, order, title in zip(
        panels[1][1:], (found.exact, *found.orders[:2]), titles, strict=True
    ):
        lobe(axes, found.angles, order.up, up=True, color=BLUE)
        lobe(axes, found.angles, order.down, up=False, color=ORANGE)
        axes.set(xlim=(-0.2, 0.2), ylim=(-0.12, 0.12))
        finish(axes, title + (f", rms {100 * order.error:.3f} %" if order.error else ""))
    out(
        "Figure 10: rms error of the series over all directions, (a) over the rms of all "
        "intensities, (b) over the"
    )
    out(
        "  intensity of the light, (c) as (a) for scattered light alone; and the bound on the "
        "flux that is left out:"
    )
    for k, order in enumerate(found.orders):
        printed = f" (paper: {PRINTED[k]} %)" if k < len(PRINTED) else ""
        errors = f"(a) {100 * order.error:.4f} %, (b) {100 * order.light_error:.4f} %"
        out(
            f"  order {k}: {errors}, (c) {100 * order.diffuse_error:.2f} %, bound "
            f"{order.bound:.1e}{printed}"
        )
    order_0, order_1 = (100 * order.error for order in found.orders[:2])
    out.record(
        order_0=quantity(order_0, "%"),
        order_1=quantity(order_1, "%", digits=3),
        orders=quantity(order_0 / order_1, digits=1),
    )
    out(
        "  The paper does not say which norm and directions it takes: its numbers lie between "
        "(a) and (b). Its estimate"
    )
    out(
        "  of .026 for what comes back holds at 45 degrees; diffuse light is reflected totally "
        "beyond 50 degrees."
    )
    figure.suptitle(
        "Paper C, figures 8 to 10: index 1.3, albedo .8, thickness 1/(2 sigma_t), light from 45 "
        "degrees"
    )
    return figure


def draw_scheme(axes: "Axes") -> None:
    """Figure 8: the three layers."""
    words = (
        "layer 1: surface, index 1.3",
        "layer 2: sigma_a .1, sigma_s .4",
        "layer 3: Lambertian ground, .8",
    )
    for k, (word, shade) in enumerate(zip(words, ("#e8f1fa", "#f6e3c5", "#dddddd"), strict=True)):
        axes.axhspan(-k - 1, -k, color=shade)
        axes.text(0.5, -k - 0.5, word, ha="center", va="center", fontsize=10)
    axes.annotate(
        "", xy=(0.3, 0.0), xytext=(0.1, 0.8), arrowprops={"arrowstyle": "->", "color": GREY}
    )
    axes.set(xlim=(0, 1), ylim=(-3, 1))
    axes.axis("off")
    axes.set_title("8: what is joined", loc="left", fontsize=10)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_option(parser)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    out = Results("many_flux_figures", options.out)
    pictures = {
        "3_4": draw_modes_and_depths(out),
        "5": draw_paths(out),
        "6_7": draw_lobes(out),
        "8_10": draw_joined(compute(), out),
    }
    out.save()
    for name, figure in pictures.items():
        figure.savefig(options.out / f"many_flux_{name}.png", dpi=110)
    print("pictures: " + ", ".join(f"many_flux_{name}.png" for name in pictures))


if __name__ == "__main__":
    main()
