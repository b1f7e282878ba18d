"""How sure: Laplace and chains on the unknowns of films and bands."""
