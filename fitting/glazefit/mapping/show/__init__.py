"""Views of a map: counts, pictures, the page of a report, tables on the screen."""
