"""The lowest floor: files and folders written whole or not at all, the cache folder, and the HTTP client."""
