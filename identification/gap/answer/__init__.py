"""What is said of the explanation that was chosen: intervals, places, notes, laws in SI units, and
what to measure next."""
