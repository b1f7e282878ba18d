"""k and s of each film by itself, wavelength by wavelength."""
