"""sealag.margin."""
