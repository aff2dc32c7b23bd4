"""sealag.simulation."""
