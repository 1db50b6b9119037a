"""The lowest floor: files and folders written whole or not at all, the cache, compiled code, the HTTP client."""
