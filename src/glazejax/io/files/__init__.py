"""Files of spectra in and out, whatever format they have."""
