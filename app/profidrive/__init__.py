"""PROFIdrive: words, states and scaling of a drive on standard telegram 1."""
