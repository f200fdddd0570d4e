"""Regions that beams have painted outside the building, through doors, windows and glass: no rooms."""
