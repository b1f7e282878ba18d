"""Which paints, in which coats, give a wanted colour."""
