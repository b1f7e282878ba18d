"""From measured films to absorption and scattering: film by film, or all films with their mixtures
together.
"""
