"""The commands. Each parses its options and calls `bsg_data` or `bsg_models`."""
