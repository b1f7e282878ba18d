"""Numerical methods that the tasks share."""
