"""Scenes path-traced by Mitsuba 3, for light that goes everywhere."""
