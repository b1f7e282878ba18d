"""What the HTML reports of an identification and of a map share: style, frame, words."""
