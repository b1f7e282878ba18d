"""Answers for pixels: representatives are searched in full, all others follow from these."""
