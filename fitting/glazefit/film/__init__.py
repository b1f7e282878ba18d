"""Measured films and what the inverse tasks share: readers, the model of one film, noise and model
errors.
"""
