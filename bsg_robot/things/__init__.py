"""Everyday things, the rooms and the furniture where people keep them; by tables."""
