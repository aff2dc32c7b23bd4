"""sealag.design."""
