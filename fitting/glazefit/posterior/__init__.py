"""Posteriors, by Laplace and by chains, of the unknowns of films and bands."""
