"""Train networks: masked buildings per epoch, optimisers, checkpoints."""
