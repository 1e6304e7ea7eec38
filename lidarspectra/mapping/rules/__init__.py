"""Rules that light is held against, and the probability that a room keeps them."""
