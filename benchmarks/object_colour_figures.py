"""Paper B's pictures and diagrams, and its findings beside ours.

The monitor's matrix and tables; Phong spheres, whose colours lie between body and light; copper by exact Fresnel, by
Cook and Torrance and by Hall; two joined planes that light each other. Everything is spectral, 400-700 nm step 5 as in
the paper. Its measured spectra are figures only: colour-science's ColorChecker patches, illuminant A (its slide
projector) and D55 (its sunlight) stand for them. Run with ``python -m benchmarks.object_colour_figures``.
"""

import argparse
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from benchmarks.object_colour_panels import figure_of
from benchmarks.results import Results, add_option
from benchmarks.timing import environment
from glazejax import colour
from glazejax.appearance import shading
from glazejax.appearance.display.display import Display
from glazejax.appearance.display.tone import ToneCurve, look_up
from glazejax.appearance.interreflection import all_bounces, one_bounce
from glazejax.appearance.metals import metal
from glazejax.commands.main import start_jax
from glazejax.radiative.common.fresnel import (
    cook_torrance_reflectance,
    hall_extinction,
    hall_reflectance,
)

GRID = np.arange(400.0, 701.0, 5.0)
PRINTED = np.array([[4.784, -2.342, -0.694], [-1.481, 2.592, 0.037], [0.045, -0.169, 0.894]])
ANGLES = np.arange(0.0, 87.6, 2.5)
METALS = ("copper-hagemann", "copper", "gold", "silver", "aluminium")
FORMS = ("exact Fresnel", "Cook-Torrance", "Hall")
KNOWN = "Hall, n and k known"
OPENING, WIDTH = 30.0, 20.0
PLATE_ANGLE, PLATE_ROUGHNESS, PLATE_DISTANCE = 80.0, 8.0, 20.0


class Locus(NamedTuple):
    """A line of chromaticities and what it is called."""

    name: str
    xy: np.ndarray


def lamp(name: str) -> np.ndarray:
    """Spectrum of a CIE illuminant on the grid, Y = 1 for a white that faces it."""
    science = colour.colour_science()
    light = science.SDS_ILLUMINANTS[name].copy().align(science.SpectralShape(400, 700, 5)).values
    return light / (light @ weights()[:, 1])


def weights() -> np.ndarray:
    """Colour matching functions as weights of a spectrum of light, paper B, eq (25)."""
    return colour.colour_weights(GRID, "E")


def xyz(spectra) -> np.ndarray:
    return np.asarray(spectra) @ weights()


def chromaticity(spectra) -> np.ndarray:
    values = xyz(spectra)
    return values[..., :2] / values.sum(axis=-1, keepdims=True)


def patches(*names: str) -> list[np.ndarray]:
    """Reflectances of ColorChecker patches on the grid."""
    science = colour.colour_science()
    chart = science.SDS_COLOURCHECKERS["BabelColor Average"]
    return [chart[n].copy().align(science.SpectralShape(400, 700, 5)).values for n in names]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    add_option(parser)
    options = parser.parse_args()
    start_jax()
    results = Results("object_colour_figures", options.out)
    results(environment("colour-science"))
    monitor(results)
    pictures = {"spheres": spheres(results), "copper": copper(results), "planes": planes(results)}
    results.save(figure_of(pictures))


def monitor(results: Results) -> None:
    """The monitor of section 2: matrix and tables."""
    results()
    results("Monitor (section 2)")
    display = Display.paper_monitor()
    results("        T, printed                  T, eq (3) with second row 1")
    for one, two in zip(PRINTED, display.matrix, strict=True):
        results("  " + " ".join(f"{v:7.3f}" for v in one) + "     " + " ".join(f"{v:7.3f}" for v in two))
    largest = np.abs(PRINTED).max()
    results(f"  largest difference {np.abs(display.matrix - PRINTED).max() / largest:.1%} of the largest number")
    for green in (0.607, 0.597):
        results(
            f"  nearest T within the rounding of the primaries, y of green {green}: {nearest_matrix(green):.4f} off"
        )
    results("  printed T has three decimals, so y = .607 of green is a misprint for .597")
    tone = ToneCurve.from_gamma(2.2)
    coarse, fine = tone.tables()
    light = np.linspace(0.0, 14.0, 14001)
    for words, table in (("one table of 256", None), ("a second one, ten times finer below 14", fine)):
        wrong = np.abs(255 * np.asarray(tone.light(look_up(light, coarse, table).astype(float))) - light)
        results(f"  gamma 2.2, light 0-14 of 255 by {words}: error {wrong.max():.2f} at most, {wrong.mean():.3f} mean")


def nearest_matrix(green_y: float) -> float:
    """Largest difference from the printed T that is left within the rounding of all printed primaries."""
    display = Display.paper_monitor()
    start = np.concatenate([display.chromaticities.ravel(), display.luminances])
    start[3] = green_y
    half = np.concatenate([np.full(6, 0.0005), np.full(3, 0.05)])

    def off(shares: np.ndarray) -> np.ndarray:
        moved = start + shares * half
        return (Display(moved[:6].reshape(3, 2), moved[6:]).matrix - PRINTED).ravel()

    return float(np.abs(off(least_squares(off, np.zeros(9), bounds=(-1, 1)).x)).max())


def spheres(results: Results) -> dict:
    """Phong spheres of section 6.1, seen along the light."""
    results()
    results("Spheres (section 6.1): S_s = 5, read as percent, n = 11, light and eye in one direction")
    light = lamp("A")
    bodies = patches("red", "green", "blue")
    count = 720
    x, y = np.meshgrid(np.linspace(-1.04, 1.04, count), np.linspace(1.04, -1.04, count))
    inside = x**2 + y**2 < 1
    normal = np.stack([x, y, np.sqrt(np.where(inside, 1 - x**2 - y**2, 0.0))], axis=-1)[inside]
    towards = np.broadcast_to([0.0, 0.0, 1.0], normal.shape)
    facing = shading.dot(jnp.asarray(normal), jnp.asarray(towards))
    mirrored = shading.dot(shading.mirror_direction(jnp.asarray(normal), jnp.asarray(towards)), jnp.asarray(towards))
    images, loci, bound = [], [], 0.0
    for name, body in zip(("red", "green", "blue"), bodies, strict=True):
        seen = np.asarray(shading.phong(body, light, facing, mirrored, specular=0.05, exponent=11.0))
        image = np.zeros((count, count, 3))
        image[inside] = xyz(seen)
        images.append(image.reshape(count // 2, 2, count // 2, 2, 3).mean(axis=(1, 3)))  # smooth edges
        found, ends = chromaticity(seen[np.asarray(facing) > 0]), chromaticity(np.stack([body * light, light]))
        along = ends[1] - ends[0]
        share = (found - ends[0]) @ along / (along @ along)
        off = np.linalg.norm(found - ends[0] - share[:, None] * along, axis=1).max()
        bound = max(bound, off)
        loci.append((name, found[:: len(found) // 80], ends))
        results(
            f"  {name:6} from {share.min():.3f} to {share.max():.3f} of the way from body to light, off it {off:.0e}"
        )
    results(
        "  paper: chromaticities lie on the segment from body to light; ours: " + ("so" if bound < 1e-6 else "not so")
    )
    picture = np.concatenate(images, axis=1)
    return {"image": shown(picture, xyz(light), 2.0), "loci": loci, "light": chromaticity(light)}


def reflectances(name: str, cosine: np.ndarray) -> dict[str, np.ndarray]:
    """Reflectance of a metal, (..., bands), by each form; Hall's also with the mean n and k instead of n = 1."""
    bare = metal(name, GRID)
    normal, c = np.asarray(bare.reflectance(1.0)), cosine[..., None]
    found = {
        FORMS[0]: bare.reflectance(cosine),
        FORMS[1]: cook_torrance_reflectance(c, normal),
        FORMS[2]: hall_reflectance(c, normal, hall_extinction(normal.mean())),
        KNOWN: hall_reflectance(c, normal, bare.extinction.mean(), bare.refractive_index.mean()),
    }
    return {form: np.asarray(values) for form, values in found.items()}


def copper(results: Results) -> dict:
    """Metals of section 6.2: loci of chromaticity against angle, and plates at 80 degrees."""
    results()
    results("Metals (section 6.2): xy distance from exact Fresnel, 0 to 87.5 degrees step 2.5, sunlight D55")
    results("  CT: Cook-Torrance; H: Hall, n = 1; Hk: Hall with the metal's mean n and k")
    results("                      from the exact locus (figure 12)            at the same angle")
    results("  metal                CT      H     Hk    H/CT  Hk/CT       CT      H     Hk    H/CT  Hk/CT")
    light = lamp("D55")
    cosines = np.cos(np.deg2rad(ANGLES))
    for name in METALS:
        fine = chromaticity(metal(name, GRID).reflectance(np.cos(np.linspace(0, np.pi / 2, 4001))) * light)
        forms = {form: chromaticity(values * light) for form, values in reflectances(name, cosines).items()}
        exact = forms.pop(FORMS[0])
        far = [np.linalg.norm(xy[:, None] - fine, axis=-1).min(axis=1).max() for xy in forms.values()]
        same = [np.linalg.norm(xy - exact, axis=1).max() for xy in forms.values()]
        results(f"  {name:16}" + "".join(columns(three) for three in (far, same)))
    found = {form: values for form, values in reflectances(METALS[0], cosines).items() if form in FORMS}
    row = int(np.argmin(np.abs(ANGLES - 75.0)))
    luminance = {form: xyz(values * light)[:, 1] for form, values in found.items()}
    results(
        "  copper-hagemann is the copper of Palik's handbook, which the paper used. Its luminance at 75 degrees: "
        + ", ".join(f"{luminance[form][row]:.3f} {form}" for form in FORMS)
    )
    results("  paper: Cook-Torrance falls off near 75 degrees and leaves the locus, Hall follows it")
    loci = [Locus(form, chromaticity(values * light)) for form, values in found.items()]
    return {
        "loci": loci,
        "light": chromaticity(light),
        "curves": found,
        "wavelengths": GRID,
        "angles": ANGLES,
        "plates": {form: plate(form, light, results) for form in FORMS},
    }


def columns(distances: list[float]) -> str:
    """Three distances and how many times smaller Hall's are."""
    cook, hall, known = distances
    return f"  {cook:.4f} {hall:.4f} {known:.4f} {hall / cook:6.2f} {known / cook:6.2f} "


def plate(form: str, light: np.ndarray, results: Results) -> np.ndarray:
    """A rough copper plate lit by parallel light at 80 degrees, the eye in the mirror direction of its middle."""
    height, width = 120, 240
    theta = np.deg2rad(PLATE_ANGLE)
    x, y = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    point = np.stack([x, y / np.cos(theta) * 0.5, np.zeros_like(x)], axis=-1)
    # The light comes from +y, the eye sits at -y; foreshortened, the plate fills the picture.
    towards = np.broadcast_to([0.0, np.sin(theta), np.cos(theta)], point.shape)
    eye = PLATE_DISTANCE * np.array([0.0, -np.sin(theta), np.cos(theta)])
    view = (eye - point) / np.linalg.norm(eye - point, axis=-1, keepdims=True)
    half = np.asarray(shading.half_vector(jnp.asarray(towards), jnp.asarray(view)))
    cos_facet = np.sum(view * half, axis=-1)
    fresnel = reflectances(METALS[0], cos_facet)[form]
    seen = shading.torrance_sparrow(
        fresnel, light, towards[..., 2], view[..., 2], half[..., 2], cos_facet,
        width=np.deg2rad(PLATE_ROUGHNESS),
    )  # fmt: skip
    middle = np.asarray(seen)[height // 2, width // 2]
    spot = chromaticity(middle)
    results(f"  plate at {PLATE_ANGLE:g} degrees, {form:14} middle: x {spot[0]:.4f}  y {spot[1]:.4f}")
    # N.V is small at 80 degrees and divides: the picture is exposed for it, the same for all three.
    return shown(xyz(seen), xyz(light), 0.8 * np.cos(theta))


def planes(results: Results) -> dict:
    """Two joined planes of section 6.3, blue-green above and yellow below."""
    results()
    results(f"Joined planes (section 6.3): gamma {OPENING:g} degrees, w {WIDTH:g}, sunlight D55 along the bisector")
    light = lamp("D55")
    above, below = patches("bluish green", "yellow")
    lit = np.sin(np.deg2rad(OPENING / 2))
    place = np.linspace(0.0, 1.0, 101)
    product = chromaticity(above * below * light)
    ways, strips = {}, {}
    for name, bounces in (("one bounce", one_bounce), ("all bounces", all_bounces)):
        pair = bounces(above, below, lit, lit, light, place, OPENING)
        ways[name] = [np.asarray(side) for side in pair]
        for side, body, label in zip(ways[name], (above, below), ("above", "below"), strict=True):
            own, found = chromaticity(body * light), chromaticity(side)
            distance = np.linalg.norm(found - product, axis=1)
            along = product - own
            share = (found - own) @ along / (along @ along)
            off = np.linalg.norm(found - own - share[:, None] * along, axis=1).max()
            nearer = "nearer at every step" if np.all(np.diff(distance) > 0) else "not nearer at every step"
            results(
                f"  {name:11} {label}: {share[-1]:.3f} of the way to the product of both at the outer edge, "
                f"{share[0]:.3f} at the joint, {nearer}; off the segment {off:.0e}"
            )
    results(
        "  paper: colours lie about on the segment and move to the product towards the joint; ours: so, with one bounce"
    )
    first = [body * lit * light for body in (above, below)]
    ways["none"] = [np.broadcast_to(value, ways["one bounce"][0].shape) for value in first]
    joint = [xyz(ways[name][0][0])[1] for name in ("none", "one bounce", "all bounces")]
    results(
        f"  light at the joint of the upper plane: {joint[1] / joint[0]:.2f} times its own with one bounce, "
        f"{joint[2] / joint[0]:.2f} with all: one bounce misses {1 - joint[1] / joint[2]:.0%}"
    )
    for name in ("none", "one bounce", "all bounces"):
        upper, lower = ways[name]
        column = np.concatenate([upper[::-1], lower])
        strips[name] = shown(np.repeat(xyz(column)[:, None], 150, axis=1), xyz(light), 1.0 / (lit * 1.9))
    return {
        "strips": strips,
        "loci": [(name, *(chromaticity(side) for side in ways[name])) for name in ("one bounce", "all bounces")],
        "bodies": [chromaticity(above * light), chromaticity(below * light)],
        "product": product,
        "light": chromaticity(light),
    }


def shown(values: np.ndarray, white: np.ndarray, exposure: float) -> np.ndarray:
    """XYZ as an sRGB picture in [0, 1] for an eye adapted to the light."""
    display = Display.preset("sRGB")
    digital = display.to_rgb(display.adapt(exposure * values, white), gamut="clip")
    return np.asarray(digital.rgb) / 255.0


if __name__ == "__main__":
    main()
