"""Maps of paintings whose truth is known."""
