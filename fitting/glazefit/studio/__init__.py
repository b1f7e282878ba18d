"""What the glaze studio searches for: recipes, paints in a film, paints from films; each answers in
plain JSON.
"""
