"""What effects are made of and have in common: curves, knees, drifts, gains, lost motion; how a law
is looked at more closely, and how an effect declares itself."""
