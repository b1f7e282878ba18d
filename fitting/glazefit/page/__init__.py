"""Style, frame and words that the HTML reports of an identification and of a map share."""
