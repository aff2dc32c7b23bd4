"""sealag.report."""
