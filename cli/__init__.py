"""The command line: thin commands over `bsg_data` and `bsg_models`."""
