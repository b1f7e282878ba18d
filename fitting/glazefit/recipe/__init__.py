"""Recipes: the paints and coats that give a wanted colour."""
