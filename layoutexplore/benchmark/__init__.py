"""The exploration benchmark: floor plans x starts x agents -> results."""
