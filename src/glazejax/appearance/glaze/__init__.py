"""A glaze as a material: tables over all angles, and how they are evaluated."""
