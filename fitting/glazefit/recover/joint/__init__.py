"""k and s of all paints in some films, fitted together."""
