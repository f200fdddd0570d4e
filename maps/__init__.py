"""Floor plans: loaders (one format a file), the plans that ship, and the procedural generator."""
