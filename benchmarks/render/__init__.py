"""Renderers: pictures, plugin, exports, and the truth for layered paint."""
