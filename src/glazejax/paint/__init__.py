"""What a painter describes: pigments, mixtures, coats and stacks of them."""
