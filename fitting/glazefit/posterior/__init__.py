"""How sure: Laplace and emcee on the unknowns of films and bands."""
