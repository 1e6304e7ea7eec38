"""Which class of material every face is of: the network's votes, priors, and smoothing (paper, Section 2.3.1)."""
