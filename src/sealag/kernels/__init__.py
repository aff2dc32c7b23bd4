"""sealag.kernels."""
