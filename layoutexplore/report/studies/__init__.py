"""Pages of studies (`layoutexplore evaluate`)."""
