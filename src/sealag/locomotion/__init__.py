"""sealag.locomotion."""
