"""Films and mixtures as they will look, how sure that is, and which reading would teach most."""
