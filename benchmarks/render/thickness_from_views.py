"""A brush stroke's thickness map from three rendered views, by Mitsuba's derivatives through the
plugin's table.

    python -m benchmarks.render.thickness_from_views [--out FOLDER] [--size N] [--steps N]

A panel with a glaze of even ground and painted thickness (benchmarks.render.strokes) is rendered from
three sides under one area light, with many samples. Then an even map is fitted to the three
pictures by Adam: each step renders one view with few samples and other random numbers than the
pictures had, and takes the derivative by every texel (integrator prb). The glaze keeps the mirror
of its surface. Prints the error of the map on the way, and draws it.
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

import glazejax as gj
from benchmarks.render.strokes import brush_strokes
from benchmarks.results import Results, command_line, percent, quantities, quantity

NEEDS = ("mitsuba", "matplotlib")

PAINT, GROUND, MOST, START = "UltramarineBlue", 0.8, 6e-6, 1.4e-6
# Of a pixel, in the pictures and in a step of the fit.
TARGET_SAMPLES, SAMPLES = 1024, 16
# None sees the light mirrored.
VIEWS = ((0.0, 0.0, 3.8), (2.2, 0.6, 3.2), (-1.9, 1.2, 3.0))
_MICROMETRE = 1e-6
# Adds to a pixel's own value as its scale, so that dark ones do not count for all.
_FLOOR = 0.02


class Recovered(NamedTuple):
    """What a fit found."""

    thickness: Float[np.ndarray, "n n"]
    """m."""
    noise: float
    """Root mean square of the noise of the pictures, over the same of the pictures."""
    seconds: float
    pictures: list[Float[np.ndarray, "size size 3"]]


def scene(mi: Any, thickness: Float[np.ndarray, "n n"], size: int) -> Any:
    """The panel, three cameras with pictures of size x size, and the light."""
    from glazejax.appearance.mitsuba import glaze_bsdf

    place = mi.ScalarTransform4f().look_at
    film = {
        "type": "hdrfilm",
        "width": size,
        "height": size,
        "pixel_format": "rgb",
        "rfilter": {"type": "box"},
    }
    glaze = gj.Glaze([gj.Layer(gj.catalogue.load()[PAINT], START)], GROUND)
    found: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "prb", "max_depth": 2},
        "panel": {
            "type": "rectangle",
            "bsdf": glaze_bsdf(glaze, thickness=thickness, thickness_max=MOST),
        },
        "light": {
            "type": "rectangle",
            "to_world": place([2.5, 4, 4], [0, 0, 0], [0, 0, 1]).scale(1.2),
            "emitter": {"type": "area", "radiance": {"type": "d65", "scale": 16.0}},
        },
    }
    for k, origin in enumerate(VIEWS):
        view = place(list(origin), [0, 0, 0], [0, 1, 0])
        found[f"view_{k}"] = {"type": "perspective", "fov": 32, "to_world": view, "film": film}
    return mi.load_dict(found)


def recover(
    mi: Any,
    truth: Float[np.ndarray, "n n"],
    *,
    size: int = 128,
    target_samples: int = TARGET_SAMPLES,
    samples: int = SAMPLES,
    steps: int = 200,
    say: Callable[[str], None] = lambda line: None,
) -> Recovered:
    """Fit a thickness map to pictures of the true one.

    Args:
        mi: Mitsuba in an AD variant, the plugin registered.
        truth: m.
        size: of the pictures.
        target_samples, samples: of a pixel, in the pictures and in a step.
        steps: of Adam.
        say: called with a line now and then.
    """
    import drjit as dr

    begun = time.perf_counter()
    views = range(len(VIEWS))
    painted = scene(mi, truth, size)
    targets = [mi.render(painted, sensor=k, spp=target_samples, seed=1000 + k) for k in views]
    again = [mi.render(painted, sensor=k, spp=target_samples, seed=2000 + k) for k in views]
    pictures, others = ([np.array(image, float) for image in images] for images in (targets, again))
    apart = np.array(pictures) - np.array(others)
    noise = float(np.linalg.norm(apart) / np.sqrt(2.0) / np.linalg.norm(pictures))
    fitted = scene(mi, np.full(truth.shape, START), size)
    params = mi.traverse(fitted)
    key = next(name for name in params.keys() if name.endswith("thickness.data"))  # noqa: SIM118
    adam = mi.ad.Adam(lr=0.15)
    adam[key] = params[key]
    params.update(adam)
    for step in range(steps):
        adam.set_learning_rate(0.15 * 0.02 ** (step / steps))
        k = step % len(VIEWS)
        image = mi.render(fitted, params, sensor=k, spp=samples, seed=step)
        loss = dr.mean(dr.square((image - targets[k]) / (targets[k] + _FLOOR)), axis=None)
        dr.backward(loss)
        adam.step()
        adam[key] = dr.clip(adam[key], 0.0, MOST / _MICROMETRE)
        params.update(adam)
        if step % 25 == 24 or step == steps - 1:
            now = np.array(params[key], float)[..., 0] * _MICROMETRE
            error = np.linalg.norm(now - truth) / np.linalg.norm(truth)
            say(
                f"step {step + 1:4}: error {error:7.2%}, loss "
                f"{float(np.array(loss).ravel()[0]):.2e}"
            )
    now = np.array(params[key], float)[..., 0] * _MICROMETRE
    seconds = time.perf_counter() - begun
    return Recovered(thickness=now, noise=noise, seconds=seconds, pictures=pictures)


def main() -> None:
    options = command_line(
        __doc__, size=(48, 12, "texels along a side"), steps=(200, 20, "of the fit")
    ).parse_args()
    import mitsuba as mi  # pyright: ignore[reportMissingImports]

    mi.set_variant("llvm_ad_spectral")
    from glazejax.appearance.mitsuba import register

    register()
    results = Results("thickness_from_views", options.out, "mitsuba")
    truth = brush_strokes(options.size)
    results(
        f"Mitsuba in {mi.variant()}; {PAINT} on a ground of {GROUND}, with its gloss\n"
        f"{options.size} x {options.size} texels, mean {truth.mean() * 1e6:.2f} um, at most "
        f"{truth.max() * 1e6:.2f} um; three views of 128 x 128 pixels, {TARGET_SAMPLES} samples; "
        f"{options.steps} steps of one view, {SAMPLES} samples, other seeds"
    )
    found = recover(mi, truth, steps=options.steps, say=results)
    results(f"noise of the pictures: {found.noise:.2%} of their values")
    off = found.thickness - truth
    rms, mean = np.linalg.norm(off) / np.linalg.norm(truth), np.abs(off).mean() / truth.mean()
    results(
        f"thickness: root mean square error {rms:.2%} of the root mean square, mean absolute "
        f"error {mean:.2%} of the "
        f"mean, bias {off.mean() / truth.mean():+.2%}\n"
        f"{found.seconds:.0f} s in all, on a machine with other work to do"
    )
    errors = {"rms": rms, "absolute": mean, "bias": abs(off.mean()) / truth.mean()}
    counts = {"view_samples": TARGET_SAMPLES, "steps": options.steps, "step_samples": SAMPLES}
    results.record(
        **quantities({name: 100.0 * error for name, error in errors.items()}, "%", n=off.size),
        **quantities(counts, digits=0),
        noise=percent(found.noise, 1),
        thickest=quantity(1e6 * truth.max(), digits=1),
    )
    results.save(_figure(truth, found))


def _figure(truth, found: Recovered):
    """The three views; truth, what was found, and ten times the difference."""
    from matplotlib.figure import Figure

    from glazejax.colour import encoded_srgb

    figure = Figure(figsize=(10, 6.8), layout="constrained")
    axes = figure.subplots(2, 3)
    for k, (axis, picture) in enumerate(zip(axes[0], found.pictures, strict=True)):
        axis.imshow(encoded_srgb(np.clip(picture / np.quantile(picture, 0.98), 0.0, 1.0)))
        axis.set_title(f"view {k + 1}")
    most = truth.max() * 1e6
    maps = ((truth, "true thickness"), (found.thickness, "found from the views"))
    drawn = None
    for axis, (values, title) in zip(axes[1], maps, strict=False):
        drawn = axis.imshow(values * 1e6, vmin=0, vmax=most, cmap="bone", origin="lower")
        axis.set_title(f"{title}, µm")
    assert drawn is not None
    figure.colorbar(drawn, ax=axes[1, :2], shrink=0.8)
    drawn = axes[1, 2].imshow(
        (found.thickness - truth) * 1e6, vmin=-0.1, vmax=0.1, cmap="RdBu", origin="lower"
    )
    axes[1, 2].set_title("difference, µm")
    figure.colorbar(drawn, ax=axes[1, 2], shrink=0.8)
    for axis in axes.ravel():
        axis.set_axis_off()
    return figure


if __name__ == "__main__":
    main()
