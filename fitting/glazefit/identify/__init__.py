"""Which paints are in a measured film, with probabilities."""
