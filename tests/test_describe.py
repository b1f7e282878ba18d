import numpy as np
import pytest

from glazejax import Mixture, Pigment
from glazejax.paint.describe import (
    find_name,
    format_length,
    name_paints,
    parse_coats,
)
from glazejax.paint.media import make_media

from .refusals import refusal
from .tables import rows

SPELLINGS = "A:12um|A:12µm|A:12μm| A : 12 um |A:0.012mm|A:1.2e-5m|A:12e3nm|A:12 UM"


@pytest.mark.parametrize(
    ("text", "thickness", "repeats"),
    [
        *((text, 12e-6, 1) for text in SPELLINGS.split("|")),
        ("A:.5um", 0.5e-6, 1),
        ("A:0um", 0.0, 1),
        *((text, 5e-6, 3) for text in ("A:5um x3", "A:5umx3", "A:5 µm × 3", "A:5um X3")),
        ("A:10mm", 0.01, 1),
    ],
)
def test_thickness_and_repeats(text, thickness, repeats):
    (coat,) = parse_coats(text)
    assert coat.name == "A"
    assert coat.thickness == pytest.approx(thickness, rel=1e-12)
    assert coat.repeats == repeats
    assert coat.total == pytest.approx(thickness * repeats, rel=1e-12)


def test_order_is_kept_and_mixtures_are_read():
    top, below = parse_coats("Eosin:2um, 0.7*ZincWhite + .3 * CobaltBlue : 20um")
    assert top.parts == ((1.0, "Eosin"),)
    assert below.parts == ((0.7, "ZincWhite"), (0.3, "CobaltBlue"))
    assert below.name == "0.7 ZincWhite + 0.3 CobaltBlue"


def test_names_may_hold_blanks_digits_and_hyphens():
    (coat,) = parse_coats("Viridian 44250-b:3um")
    assert coat.name == "Viridian 44250-b"


REFUSED = r"""
| the list of coats is empty
A | coat 'A' has no thickness: write paint:thickness
A:12um,,B:2um | an empty coat
A:12um, | an empty coat
:12um | names no paint
A: | has no thickness after the colon: write A:12um
A:12 | the thickness 12 has no unit: write 12um
A:12 x3 | the thickness 12 has no unit
A:12,5um | the thickness 12 has no unit
A:12um,5um | a decimal comma\? write 12.5um
A:thick | 'thick' is not a thickness
A:nanum | 'nanum' is not a thickness
A:12in | the unit 'in' is unknown
A:-3um | the thickness -3um is negative
A:11mm | is 11 mm thick: at most 10 mm
A:5mm x3 | is 15 mm thick: at most 10 mm
A:12m | is 1.2e\+04 mm thick
A:5um x0 | number of coats '0'
A:5um x2.5 | number of coats '2.5'
A:5um twice | cannot read 'twice'
0.5*A+0.4*B:5um | fractions sum to 0.9
0.5*A+B:5um | cannot read 'B'
-0.5*A+1.5*B:5um | fraction -0.5 of A is negative
A+B:5um | cannot read 'A'
"""


@pytest.mark.parametrize(("text", "complaint"), rows(REFUSED))
def test_bad_text_is_refused_in_one_line(text, complaint):
    with refusal(complaint):
        parse_coats(text)


def test_names_are_found_whatever_their_spelling():
    names = ["UltramarineBlue", "CobaltBlue", "Zinc-White"]
    assert find_name("ultramarine blue", names) == "UltramarineBlue"
    assert find_name("ZINC_WHITE", names) == "Zinc-White"
    with refusal("there is no pigment 'Cobalt': the nearest is CobaltBlue"):
        find_name("Cobalt", names)
    with refusal("nearest is UltramarineBlue"):
        find_name("Ultramrineblu", names)
    with refusal("`glazejax render --list` shows all names"):
        find_name("xyz", names)


def test_media_are_made_from_the_shelf():
    w = [400.0, 500.0]
    shelf = {n: Pigment(n, w, [k, k], [1.0, 1.0]) for n, k in (("A", 1.0), ("B", 3.0))}
    coats = name_paints(parse_coats("a:1um, .25*a+.75*b:1um"), shelf)
    pure, mixed = make_media(coats, shelf)
    assert pure is shelf["A"]
    assert isinstance(mixed, Mixture)
    np.testing.assert_allclose(mixed.absorption, [2.5, 2.5])


def test_weights_of_a_paint_that_is_named_twice_add_up():
    names = ["ZincWhite", "Eosin"]
    mixed, pure = name_paints(
        parse_coats("0.5*ZincWhite+0.3*zinc-white+0.2*Eosin:10um, .5*Eosin+.5*eosin:1um"), names
    )
    assert mixed.parts == ((0.8, "ZincWhite"), (0.2, "Eosin"))
    assert pure.parts == ((1.0, "Eosin"),)


LENGTHS = """
0 | 0 µm
12e-6 | 12 µm
5e-8 | 50 nm
2e-3 | 2 mm
1.25e-5 | 12.5 µm
1e-7 | 0.1 µm
"""


@pytest.mark.parametrize(("metres", "words"), rows(LENGTHS))
def test_lengths_in_words(metres, words):
    assert format_length(float(metres)) == words


def test_a_missing_plus_is_said():
    with refusal(r"stands a \+, such as 10 Vermillion \+ 90 ZincWhite"):
        find_name("Vermillion 90 ZincWhite", ["Vermillion", "ZincWhite"])
    with refusal("the nearest is Red 2"):
        find_name("Red 3", ["Red 2"])
