"""Training of what tells whether a prior plan is in its place."""
