"""How well columns explain what was read: base, noise and the laws' own imperfection integrated
out exactly, and the evidence of all variants at once."""
