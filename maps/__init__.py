"""Floor plans: loaders, a procedural generator, and the plans that ship."""
