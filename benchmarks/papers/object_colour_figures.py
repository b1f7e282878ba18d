"""Paper B's findings next to ours.

The monitor's matrix and tables; Phong spheres, whose colours lie between body and light; copper by
exact Fresnel, by Cook and Torrance and by Hall; two joined planes that light each other. What the
paper measured on its monitor is shown on a simulated one and read back. Run with ``python -m
benchmarks.papers.object_colour_figures``.
"""

import numpy as np

from benchmarks.papers.object_colour import (
    COPPER,
    FORMS,
    GRID,
    chromaticity,
    lamp,
    patches,
    reflectances,
    xyz,
)
from benchmarks.papers.object_colour_monitor import (
    ONE_TABLE,
    chips,
    copper_plates,
    exposed,
    loops,
    measured,
    tables,
)
from benchmarks.papers.object_colour_panels import monitor_figure
from benchmarks.papers.object_colour_planes import planes
from benchmarks.results import Results, command_line, quantity
from glazejax.appearance import shading
from glazejax.appearance.metals import metal
from glazejax.commands.main import start_jax

NEEDS = ("matplotlib",)

ANGLES = np.arange(0.0, 87.6, 2.5)
METALS = (COPPER, "copper", "gold", "silver", "aluminium")
PLATE_ANGLE = 80.0
SPHERES = {"red": "moderate red", "green": "green", "blue": "blue"}
"""Patches that the paper's monitor can show under illuminant A; the chart's own red is too red for
it.
"""


def main() -> None:
    options = command_line(__doc__).parse_args()
    start_jax()
    results = Results("object_colour_figures", options.out, "colour-science")
    results("Monitor (section 2)")
    screen = tables(results) | chips(results)
    read = {"spheres": spheres(results), "copper": copper(results), "planes": planes(results)}
    all_angles(results)
    results.save()
    monitor_figure(screen, read).savefig(options.out / "object_colour_monitor.png", dpi=110)


def spheres(results: Results) -> dict:
    """Phong spheres of section 6.1, seen along the light."""
    results(
        "\nSpheres (section 6.1): S_s = 5, read as percent, n = 11, light and eye in one direction"
    )
    light = lamp("A")
    # Along a line through the centre; with light and eye together N.L is N.V, and R_v.L its double
    # angle's cosine.
    facing = np.sqrt(1 - np.linspace(-0.99, 0.99, 41) ** 2)
    lines, segments, bound = [], [], 0.0
    for name, body in zip(SPHERES, patches(*SPHERES.values()), strict=True):
        seen = np.asarray(
            shading.phong(body, light, facing, 2 * facing**2 - 1, specular=0.05, exponent=11.0)
        )
        found, ends = chromaticity(seen), chromaticity(np.stack([body * light, light]))
        along = ends[1] - ends[0]
        share = (found - ends[0]) @ along / (along @ along)
        off = np.linalg.norm(found - ends[0] - share[:, None] * along, axis=1).max()
        bound = max(bound, off)
        lines.append(seen)
        segments.append(ends)
        results(
            f"  {name:6} from {share.min():.3f} to {share.max():.3f} of the way from body to "
            f"light, off it {off:.0e}"
        )
    results(
        "  paper: chromaticities lie on the segment from body to light; ours: "
        + ("so" if bound < 1e-6 else "not so")
    )
    wanted = exposed(xyz(np.concatenate(lines)), loops()[0].known)
    title = "Figure 10: a line through the centre of each sphere"
    read, off = measured(results, "spheres", title, wanted)
    results.record(spheres_one_table=quantity(off[ONE_TABLE].max(), digits=3))
    return {"ends": segments, "light": chromaticity(light), "read": read}


def copper(results: Results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Metals of section 6.2: loci of chromaticity against angle, and plates at 80 degrees."""
    results(
        "\nMetals (section 6.2): xy distance from exact Fresnel, 0 to 87.5 degrees step 2.5, "
        "sunlight D55\n"
        "  CT: Cook-Torrance; H: Hall, n = 1; Hk: Hall with the metal's mean n and k\n"
        "                      from the exact locus (figure 12)            at the same angle\n"
        "  metal                CT      H     Hk    H/CT  Hk/CT       CT      H     Hk    H/CT  "
        "Hk/CT"
    )
    light = lamp("D55")
    cosines = np.cos(np.deg2rad(ANGLES))
    for name in METALS:
        fine = chromaticity(
            metal(name, GRID).reflectance(np.cos(np.linspace(0, np.pi / 2, 4001))) * light
        )
        forms = {
            form: chromaticity(values * light)
            for form, values in reflectances(name, cosines).items()
        }
        exact = forms.pop(FORMS[0])
        far = [
            np.linalg.norm(xy[:, None] - fine, axis=-1).min(axis=1).max() for xy in forms.values()
        ]
        same = [np.linalg.norm(xy - exact, axis=1).max() for xy in forms.values()]
        results(f"  {name:16}" + "".join(columns(three) for three in (far, same)))
    found = reflectances(COPPER, np.cos(np.deg2rad([75.0, PLATE_ANGLE])))
    luminance = {form: xyz(values[0] * light)[1] for form, values in found.items()}
    results(
        "  copper-hagemann is the copper of Palik's handbook, which the paper used. Its "
        "luminance at 75 degrees: " + ", ".join(f"{luminance[form]:.3f} {form}" for form in FORMS)
    )
    results(
        "  paper: Cook-Torrance falls off near 75 degrees and leaves the locus, Hall follows it"
    )
    for form in FORMS:
        # In the mirror direction the facets face half-way between light and eye.
        x, y = chromaticity(found[form][1] * light)
        results(f"  plate at {PLATE_ANGLE:g} degrees, {form:14} middle: x {x:.4f}  y {y:.4f}")
    return copper_plates(results)


def all_angles(results: Results) -> None:
    """Figure 11: copper's reflectance by the three forms over all angles."""
    fine = np.linspace(0.0, 89.5, 359)
    found = reflectances(COPPER, np.cos(np.deg2rad(fine)))
    results(
        "\nFigure 11: copper's reflectance by the approximations minus the exact one, least and "
        "most over 400-700 nm"
    )
    results("  angle      " + "".join(f"{form:>22}" for form in FORMS[1:]))
    for angle in (0.0, 30.0, 50.0, 60.0, 70.0, 75.0, 80.0, 85.0, 89.0):
        row = int(np.argmin(np.abs(fine - angle)))
        off = [found[form][row] - found[FORMS[0]][row] for form in FORMS[1:]]
        results(
            f"  {angle:5.0f} deg  " + "".join(f"{v.min():12.3f} to {v.max():6.3f}" for v in off)
        )
    worst = {form: np.abs(found[form] - found[FORMS[0]]).max(axis=1) for form in FORMS[1:]}
    results(
        "  largest difference of all angles: "
        + ", ".join(
            f"{form} {off.max():.3f} at {fine[off.argmax()]:.0f} degrees"
            for form, off in worst.items()
        )
    )
    results(
        "  paper: Cook-Torrance fits up to about 50 degrees and falls off near 75; Hall is good "
        "throughout"
    )


def columns(distances: list[float]) -> str:
    """Three distances and how many times smaller Hall's are."""
    cook, hall, known = distances
    return f"  {cook:.4f} {hall:.4f} {known:.4f} {hall / cook:6.2f} {known / cook:6.2f} "


if __name__ == "__main__":
    main()
