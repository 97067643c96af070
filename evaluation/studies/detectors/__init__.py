"""Detectors of road users side by side, on clouds that none of them was fitted to."""
