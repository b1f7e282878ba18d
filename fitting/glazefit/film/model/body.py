"""Optical thicknesses k d and s d at which every film is opaque."""

HIGHEST = (100.0, 400.0)
