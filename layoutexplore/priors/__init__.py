"""Plans known before an exploration: read or made, registered with what a robot has seen, and foreseen."""
