"""Check a dataset in full: every file is read again and compared with the manifest."""
