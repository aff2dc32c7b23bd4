"""sealag.whole_body."""
