"""A user's own reference paints as exemplars: k/s of paint that hides its ground, k and s where the
same paint was read as a tint or over cards.

A table of reflectance is read, whatever its format. The name of each spectrum says which pigment it
is of, or a column `family` does; its ending or a recipe says what the reading is of
(`film.readers`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
from jaxtyping import Float

from glazejax import Pigment, catalogue
from glazejax.catalogue.colour_index import colour_indices, family_named
from glazejax.geometry import resolve_instrument
from glazejax.io import read_spectra
from glazejax.io.quantity import Stated
from glazejax.io.source import naming
from glazejax.spectra import Bands, common_range

from ...film.films import Films, Instrument, InstrumentLike
from ...film.model.response import film_response
from ...film.readers import loose_films, one_reading, recipes_from_names
from ...film.shared_bands import SEARCHED, average, running_mean
from ...recover.joint.joint import recover_jointly
from .features import surface_in
from .templates import hiding_ratio

TINT, CARDS, OPAQUE = "k and s by tints", "k and s by cards", "k/s alone"
"""Which coefficients a reference's readings determine, and by what."""
# A reading above or below this is a level that a calibration got wrong, as for the exemplars.
_BRIGHTEST, _DARKEST = 0.985, 0.001
# Standard deviation of log k and log s from which on only k/s counts as determined.
_OPEN = 0.5


class ReferencePaint(NamedTuple):
    """One reference paint.

    Attributes:
        name: as it was read.
        colour_index: numbers in its name or its column; empty where there are none.
        pigment: its exemplar, with family and source.
        coefficients: that its readings determine: `TINT`, `CARDS` or `OPAQUE`.
    """

    name: str
    colour_index: str
    pigment: Pigment
    coefficients: str


@dataclass(frozen=True, kw_only=True)
class References:
    """Reference paints that were read.

    Attributes:
        paints: those that are understood, by name.
        unclear: for each other spectrum, its name and what to change, a line.
        notes: sentences of the reader.
    """

    paints: tuple[ReferencePaint, ...]
    unclear: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def pigments(self) -> tuple[Pigment, ...]:
        """Exemplars, to be searched with those of ``catalogue.load("pigments")``."""
        return tuple(paint.pigment for paint in self.paints)


def read_references(
    path: str | Path,
    instrument: InstrumentLike | None = None,
    **stated: Unpack[Stated],
) -> References:
    """Read reference paints from any table that `glazejax.io.read_spectra` reads.

    The name of a spectrum holds a Colour Index number or a family of ``catalogue.families()``; in a
    table with a sample a row a column `family` may say either. A spectrum is of paint that hides
    its ground, unless its name ends as `read_loose_films` describes (NAME_ob, NAME_ow: over cards)
    or is a recipe, such as ``PB29 1:10 PW6``.

    Args:
        path: of the table.
        instrument: that read it, see `glazejax.geometry.resolve_instrument`; d:8 by default. Of a
            table of both, readings with the specular component are taken if it sees that.
        stated: ``quantity``, ``unit`` and ``scale``, as `glazejax.io.read_spectra` takes them.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the table is not legal, does not cover the bands that every exemplar is known
            at, or none of its spectra is understood.
    """
    table = read_spectra(path, **stated)
    titles = [title for title in table.attributes if title.strip().lower() == "family"]
    families = dict(zip(table.names, table.attributes[titles[0]], strict=True)) if titles else {}
    seen_by = resolve_instrument(instrument)
    with naming(path):
        films = loose_films(one_reading(table, specular=bool(seen_by.geometry.sees_surface)))
        return references_of(films, families, instrument=seen_by, source=Path(path).name)


def references_of(
    films: Films,
    families: Mapping[str, str] | None = None,
    *,
    instrument: InstrumentLike | None = None,
    source: str = "references",
) -> References:
    """Reference paints from their films.

    Args:
        films: that hide their ground, or over cards.
        families: film -> family or Colour Index number; of other films the name says it.
        instrument: as for `read_references`.
        source: whose paints they are.

    Raises:
        ValueError: no film is understood, or their bands are too few.
    """
    exemplars = list(catalogue.load("pigments").values())
    grid = films.wavelengths
    lowest, highest = common_range(paint.wavelengths for paint in exemplars)
    if grid[0] > lowest or grid[-1] < highest:
        raise ValueError(
            f"references were read from {grid[0]:g} to {grid[-1]:g} nm; give spectra that hold "
            f"{lowest:g} to {highest:g} nm, which every exemplar is compared at"
        )
    stated = families or {}
    family_of: dict[str, str] = {}
    unclear = []
    recipes = recipes_from_names(films.names)
    for row, name in enumerate(films.names):
        if len(recipes[name]) > 1:
            if missing := [paint for paint in recipes[name] if paint not in films.names]:
                unclear.append(f"{name}: there is no spectrum of {missing[0]} alone; give it too")
            continue
        if not (films.opaque[row] or films.seen[row].all()):
            unclear.append(f"{name}: over one card; give {name}_ob and {name}_ow, over both")
            continue
        try:
            family_of[name] = family_named(stated.get(name) or name)
        except ValueError as error:
            unclear.append(
                f"{name}: {error}; name it as 'ultramarine' or 'PB29', or add a column family"
            )
    if not family_of:
        first = f": {unclear[0]}" if unclear else ""
        raise ValueError(f"none of the {len(films)} spectra is understood{first}")
    seen_by = resolve_instrument(instrument)
    determined = [p for p in exemplars if np.mean(np.asarray(p.identifiable)) > 0.5]
    fitted = _fitted(average(films, SEARCHED), recipes, family_of, determined, seen_by)
    paints: dict[tuple[str, bytes], ReferencePaint] = {}
    # In the order of their names, so that the order of a file changes nothing.
    for name, family in sorted(family_of.items()):
        row = films.names.index(name)
        # What was read twice counts once.
        key = (family, films.over_white[row].tobytes() + films.over_black[row].tobytes())
        if key in paints:
            continue
        pigment, by = fitted.get(name) or (
            _hiding(grid, films.over_white[row], family, determined, seen_by),
            OPAQUE,
        )
        paints[key] = ReferencePaint(
            name=name,
            colour_index=" ".join(colour_indices(stated.get(name) or name)),
            pigment=pigment.renamed(
                f"{family}/{name} ({source})",
                family=family,
                source=source,
                provenance=f"{name} of {source}; {by}",
            ),
            coefficients=by,
        )
    return References(paints=tuple(paints.values()), unclear=tuple(unclear), notes=films.notes)


def _hiding(
    wavelengths: Bands,
    reading: Bands,
    family: str,
    determined: Sequence[Pigment],
    instrument: Instrument,
) -> Pigment:
    """Paint that hides its ground: k/s as read, s as is usual for its family."""
    reading = np.clip(running_mean(wavelengths, reading, SEARCHED), _DARKEST, _BRIGHTEST)
    # A reading darker than the surface alone is of paint with less gloss.
    surface = surface_in(reading[None], instrument.seen_surface)
    scattering = _usual_scattering(determined, family, wavelengths)
    absorption = scattering * hiding_ratio(film_response(instrument), (reading - surface)[None])[0]
    return Pigment("", wavelengths, absorption, scattering)


def _fitted(
    films: Films,
    recipes: Mapping[str, Mapping[str, float]],
    family_of: Mapping[str, str],
    determined: Sequence[Pigment],
    instrument: Instrument,
) -> dict[str, tuple[Pigment, str]]:
    """Paints that are there as tints or over cards, and which of the two determines k and s.

    Args:
        films: all of them.
        recipes: of each.
        family_of: family of each paint that is understood.
        determined: exemplars with an s of their own.
        instrument: that read the films.
    """
    # Without its paints alone a tint determines nothing.
    mixed = {
        name
        for name in films.names
        if len(recipes[name]) > 1 and set(recipes[name]) <= set(films.names)
    }
    in_tints = mixed.union(*(recipes[name] for name in mixed))
    tinted = [row for row, name in enumerate(films.names) if name in in_tints]
    on_cards = [
        row
        for row, name in enumerate(films.names)
        if name in family_of and not films.opaque[row] and row not in tinted
    ]
    out: dict[str, tuple[Pigment, str]] = {}
    for rows, by in ((tinted, TINT), (on_cards, CARDS)):
        if not family_of.keys() & {films.names[row] for row in rows}:
            continue
        chosen = films.take(rows)
        recovery = recover_jointly(
            chosen, {name: recipes[name] for name in chosen.names}, instrument=instrument
        )
        rows = [row for row, paint in enumerate(recovery.paints) if paint in family_of]
        grid = recovery.wavelengths
        usual = np.array(
            [_usual_scattering(determined, family_of[recovery.paints[row]], grid) for row in rows]
        )
        steps = np.log(usual / recovery.scattering[rows])
        sd = recovery.relative_log_sd if by == TINT else recovery.log_sd
        is_open = np.median(sd[:, rows], axis=(0, 2)) > _OPEN
        # Their unit of length becomes the catalogue's: of tints one for all, whose relative
        # strengths are determined; over cards one for each, as thicknesses are not.
        levels = np.median(steps, axis=1, keepdims=True)
        if by == TINT:
            levels = np.full_like(levels, np.median(levels))
        # Where only k/s is determined, s is the usual one.
        factors = np.exp(np.where(is_open[:, None], steps, levels))
        for row, factor, alone in zip(rows, factors, is_open, strict=True):
            k, s = factor * recovery.absorption[row], factor * recovery.scattering[row]
            out[recovery.paints[row]] = (Pigment("", grid, k, s), OPAQUE if alone else by)
    return out


def log_scattering(paints: Sequence[Any], wavelengths: Bands) -> Float[np.ndarray, "paints bands"]:
    """Log s of some paints on another grid; beyond a paint's ends as at them."""
    return np.stack(
        [
            np.interp(wavelengths, np.asarray(paint.wavelengths), np.log(paint.scattering))
            for paint in paints
        ]
    )


def _usual_scattering(determined: Sequence[Pigment], family: str, wavelengths: Bands) -> Bands:
    """Median at each band of the s of a family's paints, or of all where it has none."""
    relatives = [paint for paint in determined if paint.family == family]
    return np.exp(np.median(log_scattering(relatives or determined, wavelengths), axis=0))
