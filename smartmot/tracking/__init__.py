"""Multi-object tracking: association, life cycle, the tracker, named configurations."""
