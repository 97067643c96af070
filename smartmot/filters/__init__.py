"""Motion models and the filters that estimate them."""
