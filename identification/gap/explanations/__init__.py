"""Sets of effects: what they leave of the gap, how likely they are beforehand, what they are
charged, and the probabilities of all words that follow."""
