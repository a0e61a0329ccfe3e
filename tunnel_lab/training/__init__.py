"""Training of `neural_posterior`: simulated campaigns as shards on disk, and the fit of the network to them."""
