"""Roads evaluated: points, surface, borders, objects, and the lane under many points."""
