"""Where on a known route a camera is now."""
