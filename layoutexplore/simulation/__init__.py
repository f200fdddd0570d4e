"""A robot that drives through a floor plan, scans on its way and maps what it sees."""
