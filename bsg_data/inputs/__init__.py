"""Read untrusted files within bounds: documents, archives and tables."""
