"""sealag.paper."""
