"""What others do: baselines for namers, maps and mixtures, and paintings whose truth is known."""
