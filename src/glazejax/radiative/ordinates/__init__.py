"""The default solver: discrete ordinates in even-parity form."""
