"""Identification of the paints in a measured film, with probabilities."""
