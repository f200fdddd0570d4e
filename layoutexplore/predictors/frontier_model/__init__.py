"""What lies behind a frontier: features and network (inference)."""
