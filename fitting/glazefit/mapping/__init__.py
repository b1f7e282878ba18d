"""Images of spectra: which paints, how much, how thick and how sure, pixel by pixel."""
