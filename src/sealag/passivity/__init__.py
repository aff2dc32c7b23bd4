"""sealag.passivity."""
