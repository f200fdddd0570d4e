"""A user's own building: from a map or picture to a floor plan with rooms, and what to correct in it."""
