"""Training the network that completes maps (`layoutexplore evaluate train-floor`)."""
