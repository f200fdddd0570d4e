"""Training what cuts the tree of merges into rooms, together with what makes it grow."""
