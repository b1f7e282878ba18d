from contextlib import nullcontext
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazejax import Bidirectional, Glaze, Layer, plots
from glazejax.colour import lab, srgb
from glazejax.commands.plots import glaze_figure
from glazejax.commands.rendering import render

from .refusals import refusal
from .test_rendering import BLUE, RED, W

NAMES = ["Red", "Blue", "Nothing"]


def render_coats(*coats):
    glaze = Glaze(coats, 0.9)
    return render(glaze, Bidirectional(), layer=0, coat=1e-6, coats=12, tolerance=1e-4)


def curves(figure):
    """Spectra of a figure by their labels."""
    return {line.get_label(): line.get_ydata() for line in figure.axes[0].lines}


@pytest.fixture(scope="module")
def rendering():
    return render_coats(Layer(RED, 1e-6), Layer(BLUE, 2e-6), Layer(BLUE, 0.0))


@pytest.fixture(scope="module")
def figure(rendering):
    return glaze_figure(rendering, NAMES, title="T" * 300, coat="Red 1 µm", marked=3)


def test_spectra_drawn_are_those_computed(figure, rendering):
    lines = curves(figure)
    assert_array_equal(lines["the glaze"], rendering.glaze)
    assert_array_equal(lines["bare ground"], rendering.ground)
    assert_array_equal(lines["Blue alone"], rendering.alone[1])
    assert "Nothing alone" not in lines


def test_swatches_have_the_colours_and_say_them(figure, rendering):
    shade = plots.hex_colour(srgb(W, rendering.glaze))
    ground, glaze = figure.axes[1].patches
    assert plots.hex_colour(glaze.get_facecolor()[:3]) == shade
    assert plots.hex_colour(ground.get_facecolor()[:3]) == plots.hex_colour(
        srgb(W, rendering.ground)
    )
    words = " ".join(text.get_text() for text in figure.axes[1].texts)
    assert shade in words
    assert f"Lab {float(lab(W, rendering.glaze)[0]):.1f}," in words


def test_strips_show_the_three_ladders(figure, rendering):
    strips = figure.axes[2].collections
    for strip, way in zip(strips, ("glaze", "multiply", "mixing"), strict=True):
        expected = srgb(W, getattr(rendering.ladder, way))
        assert_allclose(strip.get_facecolor()[:, :3], expected, atol=1e-12)
    assert [line.get_xdata()[0] for line in figure.axes[2].lines] == [3]


def test_curves_are_chroma_and_lightness(figure, rendering):
    colours = np.asarray(lab(W, rendering.ladder.multiply))
    assert_allclose(figure.axes[3].lines[1].get_ydata(), np.hypot(colours[:, 1], colours[:, 2]))
    assert_allclose(figure.axes[4].lines[1].get_ydata(), colours[:, 0])


def test_labels_of_curves_stay_apart_and_inside(figure):
    for axes in figure.axes[3:]:
        heights = sorted(text.get_position()[1] for text in axes.texts)
        assert len(heights) == 3
        assert min(np.diff(heights)) >= 0.19 * axes.get_ylim()[1]
        assert heights[-1] <= axes.get_ylim()[1]


def test_long_titles_shrink_and_are_cut_to_fit(figure, rendering):
    longer = glaze_figure(rendering, NAMES, title="Word " * 21)
    cut, whole = figure.texts[0], longer.texts[0]
    for title in (cut, whole):
        assert title.get_window_extent().width <= 0.951 * figure.bbox.width
        assert float(title.get_fontsize()) >= 12
    assert cut.get_text().endswith("…")
    assert whole.get_text() == "Word " * 21
    assert float(whole.get_fontsize()) < 23


def test_one_layer_shows_rungs_of_its_ladder():
    result = render_coats(Layer(RED, 1e-6))
    lines = curves(glaze_figure(result, ["Red"]))
    assert set(lines) == {"bare ground", "the glaze", "5 coats", "10 coats"}
    assert_array_equal(lines["10 coats"], result.ladder.glaze[10])


def test_picture_is_written_in_the_size_promised(figure, tmp_path):
    path = tmp_path / "a.png"
    figure.savefig(path, dpi=100)
    assert matplotlib.image.imread(path).shape[:2] == (1000, 1600)


def test_drawing_leaves_the_style_alone(rendering):
    import matplotlib

    before = dict(matplotlib.rcParams)
    glaze_figure(rendering, NAMES)
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize(
    ("rgb", "text"), [((1, 0, 0.5), "#ff0080"), ((1.2, -0.1, 0), "#ff0000"), ((0, 0, 0), "#000000")]
)
def test_hex(rgb, text):
    assert plots.hex_colour(np.array(rgb)) == text


def test_where_pictures_may_go(tmp_path):
    assert plots.check_picture(tmp_path / "new.PNG") == tmp_path / "new.PNG"
    with refusal(r"pictures end in .png"):
        plots.check_picture(tmp_path / "a.txt")
    with refusal("is a folder: name a picture in it"):
        plots.check_picture(tmp_path)


def test_a_picture_is_replaced_whole_or_not_at_all(tmp_path, monkeypatch):
    from matplotlib.figure import Figure

    path = tmp_path / "a.PNG"
    with plots.picture(path, 1, 1):
        pass
    old = path.read_bytes()
    assert old.startswith(b"\x89PNG")

    def stop(self, file, **settings):
        with open(file, "wb") if isinstance(file, Path) else nullcontext(file) as out:
            out.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr(Figure, "savefig", stop)
    with pytest.raises(KeyboardInterrupt), plots.picture(path, 1, 1):
        pass
    assert path.read_bytes() == old
    assert list(tmp_path.iterdir()) == [path]


def test_a_layout_of_the_users_settings_moves_nothing(rendering, tmp_path):
    from matplotlib import rc_context

    with rc_context({"figure.constrained_layout.use": True}):
        drawn = glaze_figure(rendering, NAMES, title="T", coat="Red 1 µm", marked=3)
        assert drawn.get_layout_engine() is None
        with plots.picture(tmp_path / "plain.png", 2, 1, layout=None) as plain:
            assert plain.get_layout_engine() is None
