"""The models: one interface, one file a family, one catalogue."""
