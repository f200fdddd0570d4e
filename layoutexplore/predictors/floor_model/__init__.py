"""A network that completes a map: where, near what is known, there is floor."""
