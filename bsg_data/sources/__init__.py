"""Sources of scene graphs: the protocol, and one file for each source."""
