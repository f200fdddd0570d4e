"""The separator network: where the borders of rooms run, what lies outside, and which places share a room."""
