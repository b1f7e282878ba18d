"""A map on disk: its arrays and windows, work that goes on where it stopped, exports."""
