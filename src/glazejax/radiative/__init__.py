"""The physics: radiative transfer in layered media. Knows arrays, knows no paint."""
