"""Measured films and what the inverse tasks share: readers, the model of one film, noise and model
errors, and the core of inference: problems of films, their solution and draws.
"""
