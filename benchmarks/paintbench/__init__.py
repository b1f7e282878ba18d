"""A bench of real paint: what methods say of other people's paints, in one form and one table."""
