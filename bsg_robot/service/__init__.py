"""The service behind `bsg-serve`: HTTP and MCP."""
