"""Studies of clouds and of boxes detected in them."""
