"""One file format a module; each reads into `RawSpectra` or a table."""
