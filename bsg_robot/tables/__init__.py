"""Tables that questions of robots need, with their hashes in `SHA256SUMS`."""
