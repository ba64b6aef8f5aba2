"""Two maps of one kind held against each other, frame by frame."""
