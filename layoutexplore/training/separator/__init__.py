"""Training the separator network on simulated maps whose rooms are known."""
