"""Object search: shortest paths, orders of rooms, planners, room graphs, the simulator."""
