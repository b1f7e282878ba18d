"""The plugin compared with Mitsuba's own `roughplastic` and the exported measured BSDF: speed and error,
in one run.

    python -m benchmarks.render.mitsuba_plugin [--out FOLDER] [--count N]

For each material in LLVM: millions of `eval`, of `sample`, and of paths of a whole picture a
second, best of several turns that go round by round; and the largest error of the reflectance
factor of the body against the solver, at random pairs of angles. `roughplastic` is no model of
these glazes: its diffuse part has the glaze's colour at 45:0, and what it misses is stated the same
way.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import glazejax as gj
from benchmarks.render.measured_export import export_glaze
from benchmarks.render.strokes import brush_strokes
from benchmarks.results import Results, command_line, ends, quantities, quantity
from benchmarks.timing import time_call

NEEDS = ("mitsuba",)

WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
_TURNS, _PAIRS = 5, 64
NAMES = {
    "roughplastic": "roughplastic",
    "measured": "measured export",
    "smooth": "glaze, smooth",
    "rough": "glaze, rough",
    "thickness_map": "+ thickness map",
    "ground_map": "+ ground map",
}
"""Materials by what texts call them."""
_ROUGHNESS = 0.2


def glaze() -> gj.Glaze:
    """Ultramarine over zinc white."""
    paints = gj.catalogue.load()
    return gj.Glaze(
        [gj.Layer(paints["UltramarineBlue"], 3e-6), gj.Layer(paints["ZincWhite"], 20e-6)], 0.8
    )


def materials(folder: Path) -> dict[str, tuple[dict[str, Any], dict[str, Any] | None]]:
    """By name: as it is timed, and the same without gloss as its body's error is measured (None:
    see `main`).
    """
    from glazejax.appearance.mitsuba import glaze_bsdf
    from glazejax.appearance.scene.path.mitsuba import spectrum

    made = glaze()
    colour = np.asarray(gj.reflectance(made, gj.Bidirectional(45, 0)))
    plastic = {"type": "roughplastic", "alpha": _ROUGHNESS, "distribution": "ggx"}
    plastic |= {"int_ior": 1.5, "ext_ior": 1.0, "nonlinear": True}
    plastic["diffuse_reflectance"] = spectrum(colour, WAVELENGTHS)
    flat = {"type": "diffuse", "reflectance": spectrum(colour, WAVELENGTHS)}
    textured: dict[str, Any] = {"thickness": brush_strokes(64, 3e-6)}
    ground: dict[str, Any] = textured | {"ground": np.full((8, 8), 0.8)}
    return {
        "roughplastic": (plastic, flat),
        "measured export": (
            export_glaze(made, folder / "glossy.bsdf", WAVELENGTHS),
            export_glaze(made, folder / "matt.bsdf", WAVELENGTHS, gloss=False),
        ),
        "glaze, smooth": (glaze_bsdf(made), glaze_bsdf(made, gloss=False)),
        "glaze, rough": (
            glaze_bsdf(made, roughness=_ROUGHNESS),
            glaze_bsdf(made, roughness=_ROUGHNESS, gloss=False),
        ),
        "+ thickness map": (glaze_bsdf(made, **textured), None),
        "+ ground map": (glaze_bsdf(made, **ground), None),
    }


def worst(mi: Any, bsdf: Any, roughness: float) -> float:
    """Largest error of pi f of a body against the solver, in all bands."""
    import drjit as dr

    from glazejax.radiative.rough import rough_reflectance_factor

    made, rng = glaze(), np.random.default_rng(5)
    a, b = rng.uniform(0.02, 1.0, (2, _PAIRS, 1))
    stack = made.albedo, made.optical_thickness, 0.8
    exact = np.asarray(
        rough_reflectance_factor(*stack, roughness=roughness, cos_incidence=a, cos_viewing=b)
    )
    rows = [np.repeat(x, WAVELENGTHS.size, axis=1).ravel() for x in (a, b)]
    si = dr.zeros(mi.SurfaceInteraction3f, rows[0].size)
    azimuth = np.repeat(rng.uniform(0, 2 * np.pi, _PAIRS), WAVELENGTHS.size)
    sines = [np.sqrt(1 - x**2) for x in rows]
    si.wi = mi.Vector3f(mi.Float(sines[0]), 0.0, mi.Float(rows[0]))
    si.wavelengths = mi.UnpolarizedSpectrum(mi.Float(np.tile(WAVELENGTHS, _PAIRS)))
    wo = mi.Vector3f(
        mi.Float(sines[1] * np.cos(azimuth)),
        mi.Float(sines[1] * np.sin(azimuth)),
        mi.Float(rows[1]),
    )
    value = np.array(bsdf.eval(mi.BSDFContext(), si, wo)[0]) * np.pi / rows[1]
    return float(np.max(np.abs(value.reshape(exact.shape) - exact)))


def calls(mi: Any, bsdf: dict[str, Any], count: int) -> list[tuple[Callable[[], None], int]]:
    """eval, sample and a picture, each with the millions of times it does its work."""
    import drjit as dr

    loaded, context = mi.load_dict(bsdf), mi.BSDFContext()
    rng = mi.PCG32(size=count)
    si = dr.zeros(mi.SurfaceInteraction3f, count)
    si.uv = mi.Point2f(rng.next_float32(), rng.next_float32())
    si.wi = mi.warp.square_to_cosine_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    si.wavelengths = mi.UnpolarizedSpectrum(*(360.0 + 470.0 * rng.next_float32() for _ in range(4)))
    wo = mi.warp.square_to_cosine_hemisphere(mi.Point2f(rng.next_float32(), rng.next_float32()))
    one, two = rng.next_float32(), mi.Point2f(rng.next_float32(), rng.next_float32())
    dr.eval(si, wo, one, two)

    def evaluated() -> None:
        dr.eval(loaded.eval(context, si, wo))
        dr.sync_thread()

    def sampled() -> None:
        dr.eval(loaded.sample(context, si, one, two))
        dr.sync_thread()

    view = mi.ScalarTransform4f().look_at([0, 0, 3.4], [0, 0, 0], [0, 1, 0])
    film = {"type": "hdrfilm", "width": 128, "height": 128, "pixel_format": "xyz"}
    film["rfilter"] = {"type": "box"}
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 4},
            "sensor": {"type": "perspective", "fov": 36, "to_world": view, "film": film},
            "ball": {"type": "sphere", "bsdf": bsdf},
            "floor": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, -1.2]).scale(3),
                "bsdf": bsdf,
            },
            "light": {"type": "constant"},
        }
    )

    def rendered() -> None:
        dr.eval(mi.render(scene, spp=16))
        dr.sync_thread()

    return [(evaluated, count), (sampled, count), (rendered, 128 * 128 * 16)]


def main() -> None:
    options = command_line(__doc__, count=(1_000_000, 20_000, "of a call")).parse_args()
    import jax

    jax.config.update("jax_enable_x64", True)
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    mi.set_variant("llvm_ad_spectral")
    from glazejax.appearance.mitsuba import register

    register()
    results = Results("mitsuba_plugin", options.out, "mitsuba")
    results(f"Mitsuba in {mi.variant()}; ultramarine over zinc white, tolerance of the tables 1e-3")
    with tempfile.TemporaryDirectory() as folder:
        named = materials(Path(folder))
        made, load, best = {}, {}, {}
        for name, (bsdf, _) in named.items():
            made[name], load[name] = time_call(lambda b=bsdf: calls(mi, b, options.count))
        for _ in range(_TURNS):
            for name, works in made.items():
                for k, (work, _) in enumerate(works):
                    _, taken = time_call(work)
                    best[name, k] = min(best.get((name, k), np.inf), taken)
        head = ("eval M/s", "sample M/s", "paths M/s", "of plastic's", "load s", "table kB")
        head += ("stated error", "error")
        results(f"{'':18}" + "".join(f"{title:>14}" for title in head))
        plain = best["roughplastic", 2]
        evals = []
        for key, name in NAMES.items():
            bsdf, body = named[name]
            rates = [works[1] / best[name, k] / 1e6 for k, works in enumerate(made[name])]
            evals.append(rates[0])
            share = plain / best[name, 2]
            table = getattr(mi.load_dict(bsdf), "table", None)
            size, stated = (
                ("", "") if table is None else (f"{table.bytes / 1e3:.0f}", f"{table.error:.1e}")
            )
            error = None
            if body is not None:
                error = worst(mi, mi.load_dict(body), bsdf.get("roughness", 0.0))
            row = "".join(f"{rate:14.2f}" for rate in rates) + f"{share:14.2f}{load[name]:14.1f}"
            row += f"{size:>14}{stated:>14}" + (f"{error:14.1e}" if error is not None else "")
            results(f"{name:18}{row}")
            # Texts say nothing of plastic's paths, which are the unit, nor of how maps are loaded.
            kept = {"eval": quantity(rates[0], digits=int(key == "measured"))}
            if key != "roughplastic":
                kept["paths"] = quantity(share, digits=2)
            if key in ("smooth", "rough") and table is not None:
                kept["load"] = quantity(load[name], "s", 0)
                kept["kb"] = quantity(table.bytes / 1e3, digits=0)
            if table is not None:
                kept["stated"] = quantity(table.error, digits=1, form="e")
            if error is not None:
                exact = table is not None
                kept["error"] = quantity(
                    error, digits=2 - exact, form="e" if exact else "f", n=_PAIRS
                )
            results.record(**{f"{key}_{word}": value for word, value in kept.items()})
        # Of glazes, without plastic's own, which is the first.
        slower = [evals[0] / rate for rate in evals[2:]]
        results.record(**quantities(ends("eval_slower", slower), "times", 0))
    results(
        "paths: camera paths of up to 4 bounces, a ball over a floor under an even sky; load: "
        "with its first table"
    )
    results.save()


if __name__ == "__main__":
    main()
