"""The learnt method: watershed regions merged over their adjacency graph."""
