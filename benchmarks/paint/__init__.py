"""Recovery, identification, recipes and posteriors of paints."""
