"""sealag.actuation."""
