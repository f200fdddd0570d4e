"""The tree in which regions merge, and its best cut into rooms: learnt from what whole regions are like."""
