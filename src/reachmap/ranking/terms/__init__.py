"""The terms of a cost: of J, of margins, and of predicted seconds."""
