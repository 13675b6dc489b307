"""The diagnosis of the sim-to-real gap for users: data sets in; words, figures and files out."""
