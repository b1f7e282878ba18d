"""Paint as a painter describes it: pigments, mixtures, coats and stacks of them."""
