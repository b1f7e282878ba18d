"""Which pigments are in a film of anybody's paint: families, learnt from exemplars."""
