"""Datasets in the formats of other programs: one file a format, and a row each."""
