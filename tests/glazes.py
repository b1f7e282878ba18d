"""Glazes of the paints that ship."""

import glazejax as gj


def coated(ground, index=1.5, bands=None, **coats):
    """Paints of the catalogue over a ground, top first, each by its name and its thickness; on
    other bands than theirs if asked.
    """
    paints = gj.catalogue.load()
    layers = [
        gj.Layer(paints[name] if bands is None else paints[name].resample(bands), thickness)
        for name, thickness in coats.items()
    ]
    return gj.Glaze(layers, ground, index)
