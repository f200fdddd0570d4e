"""Pictures of grids, plans, decisions and layouts; films of explorations."""
