"""Search for the parameters of a tour by whole explorations."""
