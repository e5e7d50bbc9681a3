"""PROFIdrive: words, states and scaling of a drive, telegrams 1 and 111, parameter access."""
