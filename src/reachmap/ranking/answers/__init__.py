"""Results of a ranking: ordered lists, explanations, files."""
