"""The model of a film: how it reads, how films vary, how paints mix, and the errors of all that."""
