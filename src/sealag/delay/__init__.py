"""sealag.delay."""
