"""Simulate object search: shortest paths, orders of rooms, planners, room graphs."""
