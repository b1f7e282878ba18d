"""Optical thicknesses k d and s d that a fit of one film may take.

A clear film reads as bare card to 1e-5 at the lower ends; at the upper ones every film is opaque.
"""

LOWEST = (1e-6, 1e-5)
HIGHEST = (100.0, 400.0)
