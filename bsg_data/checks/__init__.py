"""Proof that a dataset is sound: every file is read again and none is trusted."""
