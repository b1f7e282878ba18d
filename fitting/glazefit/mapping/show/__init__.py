"""What a map looks like: counts, pictures, the page of a report, tables on the screen."""
