"""What unknown cells belong to: features, network and shapes of rooms (inference)."""
