"""sealag.cli."""
