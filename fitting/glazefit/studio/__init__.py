"""Searches of the glaze studio: recipes, paints in a film, paints from films; each answers in plain
JSON.
"""
