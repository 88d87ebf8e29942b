"""Files of strangers, read within bounds, and the documents, archives and tables in them."""
