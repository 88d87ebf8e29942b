"""Formats of belief graphs that others would bring, as an installable package.

One writes a folder, one any number of graphs into one file; neither is read back.
"""
