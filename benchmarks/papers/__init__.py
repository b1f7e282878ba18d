"""The three papers' tables and figures, ours next to theirs."""
