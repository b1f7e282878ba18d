"""Results of an identification, shown: on the screen, in tables and pictures, on a page to file."""
