"""A user's own reference paints: how they are read, what they tell, and how they move an answer."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from glazefit import identify
from glazefit.film.readers import loose_films
from glazefit.identify.families import set_up
from glazefit.identify.families.references import (
    CARDS,
    OPAQUE,
    TINT,
    read_references,
    references_of,
)
from glazefit.identify.result.groups import FamilySet
from glazefit.identify.search.options import IdentificationOptions
from glazefit.identify.show.terminal import _own_references
from glazejax import catalogue, stack_hemispherical_reflectance, stack_reflectance_factor
from glazejax.catalogue.colour_index import colour_indices, family_named
from glazejax.io import SpectraTable, write_table

from ..commands import invoke, succeed
from ..refusals import refusal

GRID = np.arange(400.0, 1001.0, 10.0)
VISIBLE = GRID <= 700.0


def band(middle, width):
    return np.exp(-0.5 * ((GRID - middle) / width) ** 2)


# A paint as none of the catalogue's: two narrow bands, as of a lake with a rare earth in it.
K = 1e5 * (0.15 + 3.0 * band(585.0, 14.0) + 1.5 * band(505.0, 12.0) + 2.0 * band(800.0, 15.0))
S = np.full(GRID.size, 4e5)
CARD = {"b": 0.03, "w": 0.9}


def film(k, s, thickness=1e-3, ground=0.0):
    """What 45:0 reads, by the solver of stacks."""
    return np.asarray(
        stack_reflectance_factor(
            (s / (k + s))[:, None],
            ((k + s) * thickness)[:, None],
            ground,
            cos_incidence=0.5**0.5,
            tolerance=1e-5,
        )
    )


def bare(ground):
    """What 45:0 reads of a Lambertian ground under a smooth surface of index 1.5."""
    nothing = np.full(GRID.size, 1e-9)
    return film(nothing, nothing, ground=ground)


def on_cards(k, s, thickness):
    """Spectra of PB29 over both cards, and of the cards."""
    films = {f"PB29_o{card}": film(k, s, thickness, ground) for card, ground in CARD.items()}
    return films | {f"PB29_{card}": bare(ground) for card, ground in CARD.items()}


def films_of(spectra, grid=GRID):
    return loose_films(SpectraTable(grid, tuple(spectra), np.stack(list(spectra.values()))))


def references(spectra, grid=GRID):
    return references_of(films_of(spectra, grid), None, instrument="45:0", source="own.csv")


@pytest.fixture(scope="module")
def odd():
    return film(K, S)


def answer(shelf, reading, added=()):
    """An answer of one paint, and the probabilities of its families."""
    found = identify(GRID, reading, [*shelf, *added], opaque=True, instrument="45:0", max_paints=1)
    return found, {one.families: one.probability for one in found.family_sets[0]}


# ---- names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "family"),
    [
        ("Hansa yellow PY74", "azo yellow"),
        ("P.B. 29", "ultramarine"),
        ("Phthalo blue PB15:3 (green shade)", "phthalocyanine blue"),
        ("Pigment Black 9, ivory", "carbon black"),
        ("cobalt blue hue PB29", "ultramarine"),
        ("burnt_umber PBr7", "burnt umber"),
        ("Lead-tin yellow, 12", "lead-tin yellow"),
        ("PY1 + PY3", "azo yellow"),
        ("ultramarine Nr. 4", "ultramarine"),
        ("Nr 9 azurite", "azurite"),
        ("rose NR 9", "madder"),
    ],
)
def test_a_name_says_its_family(name, family):
    assert family_named(name) == family


@pytest.mark.parametrize(
    ("name", "words"),
    [
        *(
            (name, "neither a Colour Index number nor a family")
            for name in ("tube 12", "ochre no 12", "Ultramarin Nr. 4")
        ),
        ("ultramarin", "nearest: ultramarine"),
        ("PY999", "no family has the Colour Index number PY999"),
        ("PB29 PW6", "PB29 and PW6 are two pigments"),
        ("umber PBr7", "PBr7 may be burnt umber or raw umber"),
        ("azurite and lead white", "lead white and azurite"),
    ],
)
def test_a_name_that_says_none_is_told(name, words):
    with refusal(words):
        family_named(name)


def test_every_family_is_named_by_its_name():
    for family in catalogue.families():
        assert family_named(family.upper()) == family
    assert colour_indices("C.I. PR 101, PR101") == ("PR101",)
    for text in ("NR 9", "NR9", "nr9", "N.R. 9"):
        assert colour_indices(text) == ("NR9",)
    for text in ("Nr. 9", "nr. 9", "NR. 9", "Nr.9", "Nr 9", "nr 9"):
        assert colour_indices(text) == ()


# ---- what is read --------------------------------------------------------------------------------


def write(path, rows, grid=GRID, titles=("Name",)):
    header = [*titles, *(f"{band:g}" for band in grid)]
    write_table(path, header, [[*names, *row] for names, row in rows])
    return path


def test_a_table_is_read_by_names_and_by_a_column(tmp_path, odd):
    rows = [(("one", "azurite"), odd), (("PB29", ""), 0.9 * odd), (("three", "PG7"), 0.8 * odd)]
    path = write(tmp_path / "own.csv", [*rows, (("four", "lapis"), odd)], titles=("Name", "Family"))
    read = read_references(path, "45:0")
    assert {paint.name: (paint.pigment.family, paint.colour_index) for paint in read.paints} == {
        "one": ("azurite", ""),
        "PB29": ("ultramarine", "PB29"),
        "three": ("phthalocyanine green", "PG7"),
    }
    (line,) = read.unclear
    assert line.startswith("four: it names neither")
    assert line.endswith("or add a column family")
    assert {paint.pigment.source for paint in read.paints} == {"own.csv"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda odd: {"PB29": odd, "two": 100 * odd}, "percent"),
        (lambda odd: {"PB29": np.where(GRID == 500, np.nan, odd)}, "not a finite number"),
        (lambda odd: {"PB29": odd - 0.9}, "negative"),
        (lambda odd: {"PB29": odd[5:]}, "from 450 to 1000 nm; give spectra that hold"),
        (lambda odd: {"tube 1": odd, "PY999": odd}, "none of the 2 spectra is understood"),
    ],
)
def test_what_cannot_be_read_is_one_line(tmp_path, odd, change, words):
    rows = [((name,), row) for name, row in change(odd).items()]
    path = write(tmp_path / "own.csv", rows, GRID[-len(rows[0][1]) :])
    with refusal(words) as told:
        read_references(path, "45:0")
    assert str(told.value).startswith(str(path))


def test_an_opaque_reference_has_the_ratio_that_the_solver_was_given(odd):
    # A sphere at 8 degrees sees the surface's mirror reflection, 4 % at an index of 1.5.
    sphere = stack_hemispherical_reflectance(
        (S / (K + S))[:, None], (1e-3 * (K + S))[:, None], 0.0, cos_incidence=np.cos(np.radians(8))
    )
    for instrument, reading in {"45:0": odd, "d:8": 0.04 + np.asarray(sphere)}.items():
        (paint,) = references_of(films_of({"PB29": reading}), instrument=instrument).paints
        assert paint.coefficients == OPAQUE
        assert_allclose(paint.pigment.absorption / paint.pigment.scattering, K / S, rtol=0.02)


def test_cards_and_tints_tell_scattering(odd):
    """k/s alone leaves s what it is for others; here s bends, and both ways see it."""
    bent = S * (GRID / 600.0) ** -1.5
    white_k, white_s = np.full(GRID.size, 40.0), np.full(GRID.size, 6e5)
    mixed = film((K + 10.0 * white_k) / 11.0, (bent + 10.0 * white_s) / 11.0)
    read = references(
        {
            **on_cards(K, bent, 6e-6),
            "PG7": film(K, bent),
            "PW6": film(white_k, white_s),
            "PG7 1:10 PW6": mixed,
        }
    )
    assert [(paint.name, paint.coefficients) for paint in read.paints] == [
        ("PB29", CARDS),
        ("PG7", TINT),
        ("PW6", TINT),
    ]
    alone = references({name: film(K, bent) for name in ("PB29", "PG7")}).paints
    for paint, opaque in zip(read.paints[:2], alone, strict=True):
        spread, as_usual = (
            np.std(np.log(np.interp(GRID, p.wavelengths, p.scattering) / bent)[VISIBLE])
            for p in (paint.pigment, opaque.pigment)
        )
        assert spread < 0.6 * as_usual, paint.name
    # Paints in tints keep their strength beside one another.
    strength = [np.median(p.pigment.scattering) for p in read.paints[1:]]
    assert strength[0] / strength[1] == pytest.approx(np.median(bent / white_s), rel=0.15)


def test_paint_that_hides_both_cards_has_a_ratio_alone():
    (paint,) = references(on_cards(K, S, 1e-3)).paints
    assert paint.coefficients == OPAQUE
    ratio = paint.pigment.absorption / paint.pigment.scattering
    assert_allclose(np.interp(GRID, paint.pigment.wavelengths, ratio), K / S, rtol=0.1)


def test_a_coat_over_one_card_is_refused(odd):
    """It tells neither k nor s, nor what they are to one another."""
    read = references({"PB29_ow": film(K, S, 6e-6, 0.9), "PB29_w": bare(0.9), "PV14": odd})
    assert read.unclear == ("PB29: over one card; give PB29_ob and PB29_ow, over both",)


def test_a_tint_of_what_was_not_read_alone_is_told(odd):
    (line,) = references({"PB29": odd, "PB29 1:10 PW6": odd}).unclear
    assert line == "PB29 1:10 PW6: there is no spectrum of PW6 alone; give it too"


# ---- what they do to an answer -------------------------------------------------------------------


def test_a_foreign_paint_is_named_by_its_reference(shelf, odd):
    reading = 0.95 * odd + 0.005
    _, before = answer(shelf, reading)
    assert max(before, key=before.__getitem__) != ("cobalt violet",)
    found, after = answer(shelf, reading, references({"PV14 of ours": odd}).pigments)
    assert after["cobalt violet",] > 0.8
    assert found.ranked(0)[0].paints == ("cobalt violet/PV14 of ours (own.csv)",)
    # What the label says is believed.
    _, wrong = answer(shelf, reading, references({"PY35": odd}).pigments)
    assert wrong["cadmium yellow",] > 0.8
    assert wrong.get(("cobalt violet",), 0.0) < 0.1


def test_order_and_duplicates_change_nothing(shelf, odd):
    other = film(0.5 * K + 2e4 * band(450.0, 40.0), S)
    spectra = {"PV14": odd, "PB29": other, "PG18": 0.9 * other}
    one, chances = answer(shelf, 0.95 * odd, references(spectra).pigments)
    twice = {**spectra, "PV14, read again": odd, "a second PB29": other}
    for again in (dict(reversed(spectra.items())), twice):
        two, repeated = answer(shelf, 0.95 * odd, references(again).pigments)
        assert repeated == pytest.approx(chances, abs=1e-9)
        assert_allclose(two.none, one.none, atol=1e-9)


def test_references_do_not_teach_how_far_paints_are_apart(shelf, odd):
    """Ten readings of one tube are nearer to one another than paints of two makers."""
    noise = np.random.default_rng(7).normal(0.0, 1e-4, (10, GRID.size))
    read = references({f"PV14, reading {n}": odd + row for n, row in enumerate(noise)})
    options = IdentificationOptions(instrument="45:0", max_paints=1)
    alone, beside = (
        set_up.search_families(GRID[VISIBLE], paints, options)
        for paints in (shelf, [*shelf, *read.pigments])
    )
    for metric, other in zip(alone.metrics, beside.metrics, strict=True):
        assert_array_equal(metric.whiten, other.whiten)


def test_references_of_the_visible_do_not_cost_the_infrared():
    """However many there are, the bands that are compared are those that the catalogue knows."""
    number = np.arange(440)
    everywhere = number < 20
    bands, taught = set_up._shared_bands(GRID, everywhere[:, None] | VISIBLE, number < 40)
    assert bands.all()
    assert_array_equal(taught, everywhere)


def test_the_answer_names_the_reference(tmp_path, odd):
    spots = write(tmp_path / "spots.csv", [(("spot",), 0.95 * odd)])
    own = write(tmp_path / "own.csv", [(("our [best] lake PV14",), odd)])
    line = f"identify {spots} --opaque --instrument 45:0 --catalogue pigments --references {own}"
    done = succeed(*line.split())
    assert "spot: cobalt violet, probability 9" in done.output
    assert "\n  nearest reference: our [best] lake PV14 (own.csv)\n" in done.output
    wrong = invoke(*line.split(), "--own-films")
    assert "--references are searched by family" in str(wrong.exception)


def test_only_references_of_the_answers_families_are_named():
    near = ["chalk/ours 1 (own)", "azurite/ours 2 (own)", "indigo/ours 3 (own)"]
    near.append(next(name for name in catalogue.provenance() if name.startswith("azurite/")))
    within = {"a white": (("lead white", 0.6), ("chalk", 0.4))}
    answer = FamilySet(families=("azurite", "a white"), probability=0.9, within=within)
    assert _own_references(near, answer) == ["ours 1 (own)", "ours 2 (own)"]


def test_a_reference_that_knows_less_does_not_win(shelf, odd):
    """The right one is known to 1000 nm and differs a little everywhere; the wrong one is as near
    in the visible, where alone it is known.
    """
    whole = references({"PV14": odd}).pigments
    cut = references({"PV16": odd[VISIBLE]}, grid=GRID[VISIBLE]).pigments
    _, chances = answer(shelf, 0.95 * odd, [*whole, *cut])
    assert chances["cobalt violet",] > chances.get(("manganese violet",), 0.0)
