"""Bundled robots and project files; no code."""
