"""k and s of one brushed coat from ladders of coats, and the next coats."""
