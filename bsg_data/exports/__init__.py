"""Export datasets to the formats of other programs: one module and one row per format."""
