"""What a ranking gives back: ordered lists, explanations, files."""
