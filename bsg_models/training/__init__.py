"""Train networks: masked buildings per epoch, optimisers, processes, learning curves."""
