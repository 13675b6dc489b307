"""The way through the sets of effects: finer shapes, further words, what no word names."""
