"""What explanations keep of their weight: withheld data, what they leave row by row, what they ask
of that which was stated; and which of them is shown."""
