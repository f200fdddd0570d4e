"""From an occupancy grid to a layout: walls, rooms, floor plan."""
