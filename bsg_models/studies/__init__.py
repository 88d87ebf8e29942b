"""Studies over many buildings: comparisons, leaderboards, object search."""
