"""Paint under a rough surface: what comes out of the paint, and what the surface reflects itself,
apart.

The surface is a dielectric of GGX facets, `roughness` its alpha as that of Mitsuba's
`roughdielectric` (the square of OpenPBR's and Disney's roughness); zero is the smooth surface. What
one facet after the other would do to the light that a single facet loses is modelled by a
compensation that is lossless and reciprocal on both sides (see `surface`)::

    from glazejax.radiative import rough
    # the paint
    rough.rough_reflectance_factor(albedo, thickness, ground, roughness=0.2, cos_incidence=0.7)
    # the surface
    rough.surface_reflectance_factor(0.7, 0.9, 30.0, roughness=0.2)
    # any ground at once
    rough.rough_ports(albedo, thickness, roughness=0.2).reflectance(ground)

`rough_ports` answers for smooth surfaces, too: R = dark + g incidence viewing/(1 - g back).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
