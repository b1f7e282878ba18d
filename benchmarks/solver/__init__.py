"""The radiative solvers: time, error, growth, compared with other programs."""
