"""sealag.robot."""
