"""Identification of the pigments in a film of anybody's paint: families, learnt from exemplars."""
