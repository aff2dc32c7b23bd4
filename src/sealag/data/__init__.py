"""sealag.data."""
